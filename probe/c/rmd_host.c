/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What a machine's controller calls of an RMD host. */
#include "unknown.h"

static motorlink_rmd_host state;

int main(void)
{
    motorlink_rmd_output todo;
    motorlink_rmd_motion_status status = { 0 };
    static motorlink_can_frame frame;

    motorlink_rmd_host_init(&state, sizeof state);
    for (;;) {
        const uint8_t motor = (uint8_t)unknown;

        motorlink_rmd_host_request(&state, now, motor, motorlink_rmd_read_motion_status());
        motorlink_rmd_host_request(&state, now, motor, motorlink_rmd_set_speed(unknown));
        motorlink_rmd_host_request(&state, now, motor, motorlink_rmd_stop());
        frame.id = (uint32_t)unknown;
        frame.size = 8;
        motorlink_rmd_host_receive(&state, now, &frame);
        motorlink_rmd_host_poll(&state, now, &todo);
        motorlink_rmd_decode_motion_status(todo.reply, &status);
        use(todo.frame.data, (size_t)status.speed_dps);
        motorlink_rmd_host_cancel(&state, now, motor);
    }
}
