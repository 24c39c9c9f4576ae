/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Simulated motors for a board without any: PLANT_ST_MOTORS behind the ST drive and PLANT_RMD_MOTORS
 * on the RMD bus, with the IDs 1 and on. Functions with a context are callbacks of motorlink.h; on a real
 * board they are the motor control.
 *
 * There is one plant. Its functions are called from the main loop, one at a time; none from an
 * interrupt.
 */
#ifndef PLANT_H
#define PLANT_H

#include "motorlink.h"

#define PLANT_ST_MOTORS 2
#define PLANT_RMD_MOTORS 4

typedef struct plant plant;

/* Motors at rest, powered on now. The context of the plant_st_ callbacks; NULL the second time. */
plant *plant_start(uint64_t now_us);

/* Moves the motors on by a slice of time, at most to now. 1 when they have reached it; 0 when they
 * are behind and the call is to be repeated. Where the board cannot keep up, they stay behind. */
uint8_t plant_advance(plant *motors, uint64_t now_us);

/* RMD motor 0 to PLANT_RMD_MOTORS - 1: the context of its plant_rmd_ callbacks; NULL beyond. */
void *plant_rmd(plant *motors, uint8_t index);

/* What a new RMD motor has in its ROM. */
void plant_rmd_rom(motorlink_rmd_settings *rom);

uint16_t plant_st_features(void *context, uint8_t motor);
int32_t plant_st_get_register(void *context, uint8_t motor, motorlink_st_reg reg);
motorlink_st_error_code plant_st_set_register(void *context, uint8_t motor, motorlink_st_reg reg, int32_t value);
void plant_st_execute(void *context, uint8_t motor, motorlink_st_command command);
void plant_st_set_ramp(void *context, uint8_t motor, int32_t speed_rpm, uint16_t duration_ms);
void plant_st_get_revup_data(void *context, uint8_t motor, uint8_t phase, motorlink_st_revup_phase *data);
void plant_st_set_revup_data(void *context, uint8_t motor, uint8_t phase,
                        const motorlink_st_revup_phase *data);
void plant_st_set_current_reference(void *context, uint8_t motor, int16_t iq_s16a, int16_t id_s16a);
void plant_st_set_torque_ramp(void *context, uint8_t motor, int32_t torque_s16a, uint16_t duration_ms);
void plant_st_set_position(void *context, uint8_t motor, float angle_rad, float duration_s);

void plant_rmd_set_mode(void *context, const motorlink_rmd_motion *motion);
void plant_rmd_configure(void *context, const motorlink_rmd_settings *settings);
void plant_rmd_sense(void *context, motorlink_rmd_sense *sense);
void plant_rmd_save(void *context, const motorlink_rmd_settings *rom);

#endif
