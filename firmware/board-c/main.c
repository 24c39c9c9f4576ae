/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * An ST drive on USART1 and RMD drives, through slcan, on USART2, with the simulated motors of plant.h.
 * The board is the one of crates/ffi/examples/bare-metal; a host can step its time on USART3 (clock.c).
 */
#include "board.h"
#include "motorlink.h"
#include "plant.h"

/* Most bytes of a port that are served before the rest of the main loop runs. */
#define TURN 32

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
    for (;;) {
        bool reached = plant_advance(motors, now_us()) != 0;
        /* Bytes may have come while the motors advanced, so this is later than the time above. */
        now = now_us();
        st_serve(now);
        rmd_serve(now);
        if (reached) {
            rest();
        }
    }
}
