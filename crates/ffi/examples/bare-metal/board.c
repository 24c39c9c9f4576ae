/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Serial ports and a timer of an STM32F4 (RM0090; PM0214 for the core). */
#include "board.h"

#define USART1 ((usart *)0x40011000)
#define USART2 ((usart *)0x40004400)
#define USART3 ((usart *)0x40004800)
#define USART_SR_ORE (1u << 3)
#define USART_SR_TXE (1u << 7)
#define USART_CR1_RE (1u << 2)
#define USART_CR1_TE (1u << 3)
#define USART_CR1_RXNEIE (1u << 5)
#define USART_CR1_UE (1u << 13)

#define TIM2_CR1 (*(volatile uint32_t *)0x40000000)
#define TIM2_CNT (*(volatile uint32_t *)0x40000024)
#define TIM2_PSC (*(volatile uint32_t *)0x40000028)
#define TIM_CR1_CEN (1u << 0)

#define SYST_CSR (*(volatile uint32_t *)0xE000E010)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018)
#define SYST_CSR_ENABLE_TICKINT_CORE 7u

/* What SysTick counts in QEMU, and on a board whose clocks are set up. */
#define CORE_HZ 168000000u
/* What TIM2 counts in QEMU. On a board it is half of the core's clock. */
#define TIMER_HZ 1000000000u

#define NVIC_ISER1 (*(volatile uint32_t *)0xE000E104)
#define USART1_IRQ 37u

port st_port = { .regs = USART1 };
port rmd_port = { .regs = USART2 };
port clock_port = { .regs = USART3 };

void port_start(port *p)
{
    /* The interrupts of the three follow each other. */
    uint32_t irq = USART1_IRQ + (p == &rmd_port ? 1u : p == &clock_port ? 2u : 0u);

    p->regs->cr1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE;
    NVIC_ISER1 = 1u << (irq - 32u);
}

static void port_interrupt(port *p)
{
    /* Reading both registers in this order clears the overrun flag. */
    bool overran = (p->regs->sr & USART_SR_ORE) != 0;
    uint8_t byte = (uint8_t)p->regs->dr;
    uint32_t put = p->put;

    if (put - p->taken < RING) {
        p->bytes[put % RING] = byte;
        p->put = put + 1;
    } else {
        overran = true;
    }
    if (overran) {
        p->lost = true;
    }
}

void usart1_handler(void);
void usart1_handler(void) { port_interrupt(&st_port); }

void usart2_handler(void);
void usart2_handler(void) { port_interrupt(&rmd_port); }

void usart3_handler(void);
void usart3_handler(void) { port_interrupt(&clock_port); }

bool port_waits(const port *p) { return p->lost || p->put != p->taken; }

bool port_take(port *p, uint8_t *byte)
{
    uint32_t taken = p->taken;

    if (taken == p->put) {
        return false;
    }
    *byte = p->bytes[taken % RING];
    p->taken = taken + 1;
    return true;
}

bool port_lost(port *p)
{
    if (!p->lost) {
        return false;
    }
    p->lost = false;
    p->taken = p->put;
    return true;
}

void port_send(port *p, const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        while ((p->regs->sr & USART_SR_TXE) == 0) {
        }
        p->regs->dr = bytes[i];
    }
    p->sent += (uint32_t)size;
}

void timer_start(void)
{
    TIM2_PSC = TIMER_HZ / 1000000u - 1;
    TIM2_CR1 = TIM_CR1_CEN;
    SYST_RVR = CORE_HZ / 1000u - 1;
    SYST_CVR = 0;
    SYST_CSR = SYST_CSR_ENABLE_TICKINT_CORE;
}

uint64_t timer_us(void)
{
    static uint32_t high, last;
    uint32_t low = TIM2_CNT;

    if (low < last) {
        high++;
    }
    last = low;
    return (uint64_t)high << 32 | low;
}
