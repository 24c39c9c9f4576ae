/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What a machine's controller calls of an ST master. */
#include "unknown.h"

static motorlink_st_master state;

int main(void)
{
    motorlink_st_output todo;
    static uint8_t received[64];

    motorlink_st_master_init(&state, sizeof state, NULL);
    for (;;) {
        const uint8_t motor = (uint8_t)unknown;

        motorlink_st_master_get_register(&state, motor, (motorlink_st_reg)unknown);
        motorlink_st_master_set_register(&state, motor, (motorlink_st_reg)unknown, unknown);
        motorlink_st_master_set_ramp(&state, motor, unknown, (uint16_t)unknown);
        motorlink_st_master_execute(&state, motor, (motorlink_st_command)unknown);
        motorlink_st_master_receive(&state, now, received, (size_t)unknown % sizeof received);
        motorlink_st_master_poll(&state, now, &todo);
        use(todo.bytes.data, todo.bytes.size);
        motorlink_st_master_abandon(&state);
    }
}
