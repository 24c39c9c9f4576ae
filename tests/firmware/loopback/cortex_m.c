/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Vectors of a Cortex-M with 16 KiB of RAM. There is no FPU set-up: the program uses none. */
#include <stdint.h>

int main(void);

static void start(void)
{
    main();
}

static void stuck(void)
{
    for (;;) {
    }
}

typedef struct {
    uint32_t stack_top;
    void (*handlers[15])(void);
} table;

extern const table vectors;
__attribute__((section(".vectors"))) const table vectors = { 0x20004000, { start, stuck, stuck, stuck, stuck, stuck, stuck } };
