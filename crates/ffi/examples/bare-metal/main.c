/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * An ST drive on USART1 and an RMD drive, through slcan, on USART2, with simulated motors. On a real
 * board, motor control replaces fan.h and motor.h, and a CAN controller replaces slcan.
 */
#include <string.h>

#include <motorlink.h>

#include "board.h"

#include "../fan.h"
#include "../motor.h"

static motorlink_st_slave slave;
static struct fan fan;
static motorlink_st_motor_control st_motor;

static void serve_st(void)
{
    motorlink_bytes reply;
    uint8_t byte;

    if (port_lost(&st_port) && motorlink_st_slave_overrun(&slave, &reply) == MOTORLINK_OK) {
        port_send(&st_port, reply.data, reply.size);
    }
    while (port_take(&st_port, &byte)) {
        if (motorlink_st_slave_receive(&slave, now_us(), byte, &reply) == MOTORLINK_OK) {
            port_send(&st_port, reply.data, reply.size);
        }
    }
    if (motorlink_st_slave_poll(&slave, now_us(), &reply) == MOTORLINK_OK) {
        port_send(&st_port, reply.data, reply.size);
    }
}

static motorlink_slcan_device adapter;
static motorlink_rmd_drive drive;
static struct motor motor;
static motorlink_rmd_motor_control rmd_motor;

static void serve_frame(const motorlink_can_frame *frame)
{
    motorlink_can_frame reply;
    motorlink_slcan_line line;

    if (motorlink_rmd_drive_receive(&drive, now_us(), frame, &reply) == MOTORLINK_OK
        && reply.id != MOTORLINK_NO_FRAME
        && motorlink_slcan_device_deliver(&adapter, now_us(), &reply, &line) == MOTORLINK_OK) {
        port_send(&rmd_port, line.bytes, line.size);
    }
}

static void serve_rmd(void)
{
    motorlink_can_frame frame;
    motorlink_slcan_line line;
    uint8_t byte;

    if (port_lost(&rmd_port)) {
        /* A byte that is in no line: the adapter refuses the line that lost bytes. */
        motorlink_slcan_device_receive(&adapter, 0, &line, &frame);
    }
    while (port_take(&rmd_port, &byte)) {
        if (motorlink_slcan_device_receive(&adapter, byte, &line, &frame) != MOTORLINK_OK) {
            continue;
        }
        port_send(&rmd_port, line.bytes, line.size);
        if (frame.id != MOTORLINK_NO_FRAME) {
            serve_frame(&frame);
        }
    }
    motorlink_rmd_drive_poll(&drive, now_us());
}

int main(void)
{
    const motorlink_rmd_drive_config config = { .id = 1 };

    clock_start();
    st_motor = fan_control(&fan);
    rmd_motor = motor_control(&motor);
    if (motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1, &st_motor) != MOTORLINK_OK
        || motorlink_slcan_device_init(&adapter, sizeof adapter) != MOTORLINK_OK
        || motorlink_rmd_drive_init(&drive, sizeof drive, &config, NULL, &rmd_motor) != MOTORLINK_OK
        || motorlink_rmd_drive_power_on(&drive, now_us()) != MOTORLINK_OK) {
        return 1;
    }
    port_start(&st_port);
    port_start(&rmd_port);
    for (;;) {
        serve_st();
        serve_rmd();
        rest();
    }
}
