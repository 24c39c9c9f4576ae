/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* All that firmware calls of an RMD drive. */
#include "unknown.h"

static void set_mode(void *context, const motorlink_rmd_motion *motion) { seen(context, motion->kind); }
static void configure(void *context, const motorlink_rmd_settings *settings)
{
    seen(context, settings->acceleration_dps2);
}
static void sense(void *context, motorlink_rmd_sense *out) { out->encoder_counts = seen(context, 0); }
static void save(void *context, const motorlink_rmd_settings *rom) { seen(context, rom->encoder_offset); }

static const motorlink_rmd_motor_control control = {
    .set_mode = set_mode,
    .configure = configure,
    .sense = sense,
    .save = save,
};

static motorlink_rmd_drive state;

int main(void)
{
    static const motorlink_rmd_drive_config config = { .id = 1 };
    static const motorlink_rmd_settings rom = { .encoder_offset = 1 };
    static motorlink_can_frame frame;
    uint64_t deadline;

    motorlink_rmd_drive_init(&state, sizeof state, &config, &rom, &control);
    motorlink_rmd_drive_power_on(&state, now);
    for (;;) {
        frame.id = (uint32_t)unknown;
        frame.size = 8;
        frame.data[0] = (uint8_t)unknown;
        motorlink_rmd_drive_receive(&state, now, &frame, &frame);
        use(frame.data, frame.size);
        motorlink_rmd_drive_poll(&state, now);
        motorlink_rmd_drive_deadline(&state, &deadline);
        now = deadline;
    }
}
