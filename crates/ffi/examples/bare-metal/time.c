/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Real time. The tests build the program with a time that a host steps. */
#include "board.h"

void clock_start(void) { timer_start(); }

uint64_t now_us(void) { return timer_us(); }

void rest(void)
{
    /* An interrupt between the check and the wait stays pending and ends the wait. */
    __asm volatile("cpsid i" ::: "memory");
    if (!port_waits(&st_port) && !port_waits(&rmd_port)) {
        __asm volatile("wfi" ::: "memory");
    }
    __asm volatile("cpsie i" ::: "memory");
}
