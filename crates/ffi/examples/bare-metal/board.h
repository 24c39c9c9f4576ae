/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * The board: serial ports and time. For QEMU's netduinoplus2, an STM32F405 without clock control, pins,
 * DMA and CAN: nothing here waits for them. On a real board their set-up comes first.
 */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* ---- board.c: ports. An interrupt fills a ring, the main loop empties it. ---- */

typedef struct {
    volatile uint32_t sr, dr, brr, cr1, cr2, cr3, gtpr;
} usart;

/* Bytes in a ring: more than the longest frame of either protocol. A power of two, so that the counters
 * may wrap around. */
#define RING 256u

typedef struct {
    usart *regs;
    volatile uint8_t bytes[RING];
    volatile uint32_t put;   /* only written by the interrupt */
    volatile uint32_t taken; /* only written by the main loop */
    volatile bool lost;      /* set by the interrupt, cleared by the main loop */
    uint32_t sent;
} port;

extern port st_port;    /* USART1 */
extern port rmd_port;   /* USART2 */
extern port clock_port; /* USART3 */

/* Enables the port and its interrupt. */
void port_start(port *p);

/* Whether bytes wait, or were lost. */
bool port_waits(const port *p);

/* Takes a byte; false if there is none. */
bool port_take(port *p, uint8_t *byte);

/* Whether bytes were lost. Those that wait are then dropped. */
bool port_lost(port *p);

/* Sends bytes; returns when the last one is in the transmitter. */
void port_send(port *p, const uint8_t *bytes, size_t size);

/* ---- board.c: the timer ---- */

/* Starts the timer, and an interrupt each millisecond, which ends a rest. */
void timer_start(void);

/* Microseconds since the start. Call it at least once an hour, or a turn of the counter is missed. */
uint64_t timer_us(void);

/* ---- time.c ---- */

/* Starts the time. */
void clock_start(void);

/* Microseconds since the start. */
uint64_t now_us(void);

/* Waits for an interrupt, unless bytes wait. */
void rest(void);

#endif
