/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What happens before main: the vector table, memory, the floating-point unit. */
#include <stddef.h>
#include <stdint.h>

/* Ends of the sections, from board.ld. */
extern uint32_t stack_top, data_start, data_end, data_image, bss_start, bss_end;

int main(void);
void reset_handler(void);
void usart1_handler(void);
void usart2_handler(void);
void usart3_handler(void);

/* Coprocessor access control: full access to 10 and 11, the FPU. */
#define CPACR (*(volatile uint32_t *)0xE000ED88)
#define CPACR_FPU (0xFu << 20)

void reset_handler(void)
{
    CPACR |= CPACR_FPU;
    __asm volatile("dsb\n isb" ::: "memory");
    const uint32_t *image = &data_image;
    for (uint32_t *word = &data_start; word < &data_end; word++) {
        *word = *image++;
    }
    for (uint32_t *word = &bss_start; word < &bss_end; word++) {
        *word = 0;
    }
    main();
    for (;;) {
        __asm volatile("wfi");
    }
}

static void tick_handler(void) {}

/* A fault, or an unexpected interrupt: the board stops. */
static void stuck_handler(void)
{
    /* Switch the power stage off here. */
    for (;;) {
        __asm volatile("wfi");
    }
}

typedef void (*handler)(void);

typedef struct {
    uint32_t *stack;
    handler exceptions[15];
    handler interrupts[40];
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    .stack = &stack_top,
    .exceptions = {
        [0] = reset_handler,
        [1] = stuck_handler, /* NMI */
        [2] = stuck_handler, /* HardFault */
        [3] = stuck_handler, /* MemManage */
        [4] = stuck_handler, /* BusFault */
        [5] = stuck_handler, /* UsageFault */
        [10] = stuck_handler, /* SVCall */
        [13] = stuck_handler, /* PendSV */
        [14] = tick_handler, /* SysTick */
    },
    .interrupts = { [37] = usart1_handler, [38] = usart2_handler, [39] = usart3_handler },
};
