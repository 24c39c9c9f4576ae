/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* All that firmware calls of an ST slave. */
#include "unknown.h"

static uint16_t features(void *context, uint8_t motor) { return (uint16_t)(seen(context, motor)); }
static int32_t get_register(void *context, uint8_t motor, motorlink_st_reg reg) { return seen(context, motor + reg); }
static motorlink_st_error_code set_register(void *context, uint8_t motor, motorlink_st_reg reg, int32_t value)
{
    return (uint8_t)seen(context, motor + reg + value);
}
static void execute(void *context, uint8_t motor, motorlink_st_command command) { seen(context, motor + command); }
static void set_ramp(void *context, uint8_t motor, int32_t speed_rpm, uint16_t duration_ms)
{
    seen(context, motor + speed_rpm + duration_ms);
}
static void get_revup_data(void *context, uint8_t motor, uint8_t phase, motorlink_st_revup_phase *data)
{
    data->speed_rpm = seen(context, motor + phase);
}
static void set_revup_data(void *context, uint8_t motor, uint8_t phase, const motorlink_st_revup_phase *data)
{
    seen(context, motor + phase + data->speed_rpm);
}
static void set_current_reference(void *context, uint8_t motor, int16_t iq_s16a, int16_t id_s16a)
{
    seen(context, motor + iq_s16a + id_s16a);
}
static void set_torque_ramp(void *context, uint8_t motor, int32_t torque_s16a, uint16_t duration_ms)
{
    seen(context, motor + torque_s16a + duration_ms);
}
static void set_position(void *context, uint8_t motor, float angle_rad, float duration_s)
{
    seen(context, motor + (angle_rad > duration_s));
}

static const motorlink_st_motor_control control = {
    .version = { .name = "ST MC SDK", .major = 5, .minor = 4, .patch = 4 },
    .features = features,
    .get_register = get_register,
    .set_register = set_register,
    .execute = execute,
    .set_ramp = set_ramp,
    .get_revup_data = get_revup_data,
    .set_revup_data = set_revup_data,
    .set_current_reference = set_current_reference,
    .set_torque_ramp = set_torque_ramp,
    .set_position = set_position,
};

static motorlink_st_slave state;

int main(void)
{
    motorlink_bytes reply;
    uint64_t deadline;

    motorlink_st_slave_init(&state, sizeof state, (motorlink_st_profile)unknown, 2, &control);
    for (;;) {
        motorlink_st_slave_receive(&state, now, (uint8_t)unknown, &reply);
        use(reply.data, reply.size);
        motorlink_st_slave_poll(&state, now, &reply);
        use(reply.data, reply.size);
        motorlink_st_slave_deadline(&state, &deadline);
        now = deadline;
        motorlink_st_slave_overrun(&state, &reply);
        use(reply.data, reply.size);
    }
}
