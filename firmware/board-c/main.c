/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * A board that answers for an ST drive on USART1 and for RMD drives, through slcan, on USART2, with
 * simulated motors behind them: what motorlink.h asks of firmware in C. USART3 is the clock port: a
 * host that steps the board's time.
 *
 * It is for QEMU's netduinoplus2, an STM32F405 without clock control, pins, DMA and CAN: nothing
 * here waits for them. On a real board their set-up comes first, a CAN controller's frames go to the
 * drives without slcan, and the callbacks of plant.h are the motor control.
 */
#include <stdbool.h>

#include "motorlink.h"
#include "plant.h"

/* ---- Registers (RM0090; PM0214 for the core) ---- */

typedef struct {
    volatile uint32_t sr, dr, brr, cr1, cr2, cr3, gtpr;
} usart;

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

#define NVIC_ISER1 (*(volatile uint32_t *)0xE000E104)
#define USART1_IRQ 37
#define USART2_IRQ 38
#define USART3_IRQ 39

/* What SysTick counts in QEMU, and on a board whose clocks are set up. */
#define CORE_HZ 168000000u
/* What TIM2 counts in QEMU. On a board it is half of the core's clock. */
#define TIMER_HZ 1000000000u

/* ---- UARTs: the interrupt fills a ring, the main loop empties it ---- */

/* Bytes that wait: more than the longest frame of either protocol. A power of two, so that the
 * counters may run over. */
#define RING 256u
/* Bytes that a port takes before the other duties of the main loop have their turn. */
#define TURN 32

typedef struct {
    usart *regs;
    volatile uint8_t bytes[RING];
    volatile uint32_t put;   /* only written by the interrupt */
    volatile uint32_t taken; /* only written by the main loop */
    volatile bool lost;      /* set by the interrupt, cleared by the main loop */
    uint32_t sent;
} port;

static port st_port = { .regs = USART1 };
static port rmd_port = { .regs = USART2 };
static port clock_port = { .regs = USART3 };

static void port_start(port *p)
{
    p->regs->cr1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE;
}

static void port_interrupt(port *p)
{
    /* The overrun flag goes with the reading of both registers, in this order. */
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

static bool port_waits(const port *p) { return p->lost || p->put != p->taken; }

static bool port_take(port *p, uint8_t *byte)
{
    uint32_t taken = p->taken;

    if (taken == p->put) {
        return false;
    }
    *byte = p->bytes[taken % RING];
    p->taken = taken + 1;
    return true;
}

/* Whether bytes were lost; what waits with them is dropped. */
static bool port_lost(port *p)
{
    if (!p->lost) {
        return false;
    }
    p->lost = false;
    p->taken = p->put;
    return true;
}

static void port_send(port *p, const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        while ((p->regs->sr & USART_SR_TXE) == 0) {
        }
        p->regs->dr = bytes[i];
    }
    p->sent += (uint32_t)size;
}

/* ---- Time: that of a timer, or that of a host which steps it ---- */

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

static void clock_start(void)
{
    TIM2_PSC = TIMER_HZ / 1000000u - 1;
    TIM2_CR1 = TIM_CR1_CEN;
    /* Wakes the core each millisecond, for the motors and for deadlines. */
    SYST_RVR = CORE_HZ / 1000u - 1;
    SYST_CVR = 0;
    SYST_CSR = SYST_CSR_ENABLE_TICKINT_CORE;
}

/* Microseconds since the start. To be asked at least once an hour, or a turn of the counter is
 * missed. A host's first byte stops the timer's time, even where the motors' time is behind it and
 * clock_serve is not called: on a slow machine they would never catch up with it. */
static uint64_t now_us(void)
{
    static uint32_t high, last;

    if (board_clock.stepped) {
        return board_clock.now;
    }
    uint32_t low = TIM2_CNT;
    if (low < last) {
        high++;
    }
    last = low;
    board_clock.now = (uint64_t)high << 32 | low;
    board_clock.stepped = port_waits(&clock_port);
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

/* Obeys the clock port. To be called when everything that is due now is done. Returns whether there
 * may be more to do at once.
 *
 * A command is a byte, and its answer is two. 1 to 254 advances by so many ticks, but no further than
 * the first tick at whose end bytes have moved on the other ports since the last answer; the answer
 * is the number of ticks. 0 asks for the number of bytes that the other ports have taken since the
 * last answer, 254 for more. The second byte is the number of bytes that they have sent since then. 255
 * is answered with 255 twice: what comes before that answers a former host. */
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

/* ---- The ST drive ---- */

static motorlink_st_slave slave;
static motorlink_st_motor_control st_drive = {
    .version = { .name = "ST MC SDK", .major = 5, .minor = 4, .patch = 4 },
    .features = plant_st_features,
    .get_register = plant_st_get_register,
    .set_register = plant_st_set_register,
    .execute = plant_st_execute,
    .set_ramp = plant_st_set_ramp,
    .get_revup_data = plant_st_get_revup_data,
    .set_revup_data = plant_st_set_revup_data,
    .set_current_reference = plant_st_set_current_reference,
    .set_torque_ramp = plant_st_set_torque_ramp,
    .set_position = plant_st_set_position,
};

static motorlink_error st_start(plant *motors)
{
    st_drive.context = motors;
    return motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, PLANT_ST_MOTORS,
                                   &st_drive);
}

static void st_serve(uint64_t now)
{
    motorlink_bytes reply;
    uint8_t byte;

    if (port_lost(&st_port) && motorlink_st_slave_overrun(&slave, &reply) == MOTORLINK_OK) {
        port_send(&st_port, reply.data, reply.size);
    }
    for (int n = 0; n < TURN && port_take(&st_port, &byte); n++) {
        if (motorlink_st_slave_receive(&slave, now, byte, &reply) == MOTORLINK_OK) {
            port_send(&st_port, reply.data, reply.size);
        }
    }
    if (motorlink_st_slave_poll(&slave, now, &reply) == MOTORLINK_OK) {
        port_send(&st_port, reply.data, reply.size);
    }
}

/* ---- The RMD drives ---- */

static motorlink_slcan_device adapter;
static motorlink_rmd_drive rmd_drives[PLANT_RMD_MOTORS];
static motorlink_rmd_motor_control rmd_motors[PLANT_RMD_MOTORS];

static motorlink_error rmd_start(plant *motors, uint64_t now)
{
    motorlink_rmd_settings rom;
    motorlink_error error = motorlink_slcan_device_init(&adapter, sizeof adapter);

    plant_rmd_rom(&rom);
    for (uint8_t i = 0; i < PLANT_RMD_MOTORS && error == MOTORLINK_OK; i++) {
        const motorlink_rmd_drive_config config = { .id = (uint8_t)(i + 1) };

        rmd_motors[i] = (motorlink_rmd_motor_control){
            .context = plant_rmd(motors, i),
            .set_mode = plant_rmd_set_mode,
            .configure = plant_rmd_configure,
            .sense = plant_rmd_sense,
            .save = plant_rmd_save,
        };
        error = motorlink_rmd_drive_init(&rmd_drives[i], sizeof rmd_drives[i], &config, &rom,
                                         &rmd_motors[i]);
        if (error == MOTORLINK_OK) {
            error = motorlink_rmd_drive_power_on(&rmd_drives[i], now);
        }
    }
    return error;
}

/* Hands a frame to every drive, as a bus does; the lowest ID answers first. */
static void rmd_frame(uint64_t now, const motorlink_can_frame *frame)
{
    motorlink_can_frame reply;
    motorlink_slcan_line line;

    for (int i = 0; i < PLANT_RMD_MOTORS; i++) {
        if (motorlink_rmd_drive_receive(&rmd_drives[i], now, frame, &reply) != MOTORLINK_OK
            || reply.id == MOTORLINK_NO_FRAME) {
            continue;
        }
        if (motorlink_slcan_device_deliver(&adapter, now, &reply, &line) == MOTORLINK_OK) {
            port_send(&rmd_port, line.bytes, line.size);
        }
    }
}

static void rmd_serve(uint64_t now)
{
    motorlink_can_frame frame;
    motorlink_slcan_line line;
    uint8_t byte;

    if (port_lost(&rmd_port)) {
        /* A byte that is in no line: the one under way will be refused. */
        motorlink_slcan_device_receive(&adapter, 0, &line, &frame);
    }
    for (int n = 0; n < TURN && port_take(&rmd_port, &byte); n++) {
        if (motorlink_slcan_device_receive(&adapter, byte, &line, &frame) != MOTORLINK_OK) {
            continue;
        }
        port_send(&rmd_port, line.bytes, line.size);
        if (frame.id != MOTORLINK_NO_FRAME) {
            rmd_frame(now, &frame);
        }
    }
    for (int i = 0; i < PLANT_RMD_MOTORS; i++) {
        motorlink_rmd_drive_poll(&rmd_drives[i], now);
    }
}

/* ---- The board ---- */

/* Lets the clock port advance time and otherwise waits for an interrupt, unless there is something
 * to do already. An interrupt that comes in between is pending, and ends the wait all the same. */
static void rest(void)
{
    __asm volatile("cpsid i" ::: "memory");
    if (!port_waits(&st_port) && !port_waits(&rmd_port) && !clock_serve()) {
        __asm volatile("wfi" ::: "memory");
    }
    __asm volatile("cpsie i" ::: "memory");
}

int main(void)
{
    clock_start();
    uint64_t now = now_us();
    plant *motors = plant_start(now);
    if (motors == NULL || st_start(motors) != MOTORLINK_OK
        || rmd_start(motors, now) != MOTORLINK_OK) {
        return 1;
    }
    port_start(&st_port);
    port_start(&rmd_port);
    port_start(&clock_port);
    NVIC_ISER1 = 1u << (USART1_IRQ - 32) | 1u << (USART2_IRQ - 32) | 1u << (USART3_IRQ - 32);
    for (;;) {
        bool reached = plant_advance(motors, now_us()) != 0;
        /* Bytes may have come while the motors advanced: their time is not the one before. */
        now = now_us();
        st_serve(now);
        rmd_serve(now);
        if (reached) {
            rest();
        }
    }
}
