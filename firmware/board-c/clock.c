/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Replaces time.c for tests: the timer's time, until a host steps it on USART3, the clock port.
 */
#include "board.h"

/* Time advances in ticks of this length once a host steps it. */
#define TICK_US 100u
/* The command that asks how many bytes were taken. */
#define CLOCK_COUNT 0
/* The command that a new host begins with, and both bytes of its answer. */
#define CLOCK_SYNC 255

static struct {
    bool stepped;         /* by a host, from its first byte on */
    uint64_t now;         /* while it is stepped, us */
    uint8_t ticks, done;  /* of the command to advance under way; ticks is 0 while there is none */
    uint32_t taken, sent; /* on the other ports, up to the last answer */
} board_clock;

void clock_start(void)
{
    timer_start();
    port_start(&clock_port);
}

/* A host's first byte stops the timer's time, also where the motors' time is late and clock_serve is not
 * called: on a slow machine the motors would never catch up with the timer. */
uint64_t now_us(void)
{
    if (!board_clock.stepped) {
        board_clock.now = timer_us();
        board_clock.stepped = port_waits(&clock_port);
    }
    return board_clock.now;
}

/* A number of bytes, 254 for more. */
static uint8_t byte_count(uint32_t bytes) { return bytes < 254 ? (uint8_t)bytes : 254; }

static void clock_answer(uint8_t answer)
{
    uint32_t sent = st_port.sent + rmd_port.sent;
    uint8_t second = answer == CLOCK_SYNC ? CLOCK_SYNC : byte_count(sent - board_clock.sent);
    const uint8_t bytes[] = { answer, second };

    board_clock.taken = st_port.taken + rmd_port.taken;
    board_clock.sent = sent;
    port_send(&clock_port, bytes, sizeof bytes);
}

/* Executes a command of the clock port; firmware/README.md has their list. Call it when everything
 * that is due now is done. Returns whether there may be more to do now. */
static bool clock_serve(void)
{
    uint32_t taken = st_port.taken + rmd_port.taken - board_clock.taken;
    uint32_t sent = st_port.sent + rmd_port.sent - board_clock.sent;
    uint8_t command;

    if (board_clock.ticks != 0) {
        if (board_clock.done < board_clock.ticks && taken == 0 && sent == 0) {
            board_clock.now += TICK_US;
            board_clock.done++;
        } else {
            board_clock.ticks = 0;
            clock_answer(board_clock.done);
        }
        return true;
    }
    if (!port_take(&clock_port, &command)) {
        return false;
    }
    board_clock.now = now_us();
    board_clock.stepped = true;
    if (command == CLOCK_COUNT) {
        clock_answer(byte_count(taken));
    } else if (command == CLOCK_SYNC) {
        clock_answer(CLOCK_SYNC);
    } else {
        board_clock.ticks = command;
        board_clock.done = 0;
    }
    return true;
}

/* Lets the clock port advance time, or waits for an interrupt, unless bytes wait. An interrupt between
 * the check and the wait stays pending and ends the wait. */
void rest(void)
{
    __asm volatile("cpsid i" ::: "memory");
    if (!port_waits(&st_port) && !port_waits(&rmd_port) && !clock_serve()) {
        __asm volatile("wfi" ::: "memory");
    }
    __asm volatile("cpsie i" ::: "memory");
}
