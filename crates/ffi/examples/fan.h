/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * A simulated motor behind an ST slave: a fan without load or faults, which follows a ramp exactly.
 * Include it after motorlink.h and a declaration of now_us().
 */
#ifndef MOTORLINK_EXAMPLE_FAN_H
#define MOTORLINK_EXAMPLE_FAN_H

struct fan {
  int running;
  int32_t from_rpm, to_rpm;
  uint64_t began_us, length_us;
  motorlink_st_revup_phase revup[5];
  /* What a master may set, and read again. */
  int32_t values[256];
};

static int32_t speed(const struct fan *fan) {
  uint64_t passed = now_us() - fan->began_us;
  int64_t way = (int64_t)fan->to_rpm - fan->from_rpm;
  if (!fan->running) {
    return 0;
  }
  if (passed >= fan->length_us) {
    return fan->to_rpm;
  }
  return (int32_t)(fan->from_rpm + way * (int64_t)passed / (int64_t)fan->length_us);
}

static int32_t read_register(void *context, uint8_t motor, motorlink_st_reg reg) {
  const struct fan *fan = (const struct fan *)context;
  (void)motor;
  switch (reg) {
    case MOTORLINK_ST_REG_STATUS:
      return fan->running ? MOTORLINK_ST_STATUS_RUN : MOTORLINK_ST_STATUS_IDLE;
    case MOTORLINK_ST_REG_SPEED_REF:
    case MOTORLINK_ST_REG_SPEED_MEAS:
      return speed(fan);
    case MOTORLINK_ST_REG_RAMP_FINAL_SPEED:
      return fan->to_rpm;
    case MOTORLINK_ST_REG_BUS_VOLTAGE:
      return 24;
    case MOTORLINK_ST_REG_HEATS_TEMP:
      return 25;
    case MOTORLINK_ST_REG_RUC_STAGE_NBR:
      return 5;
    case MOTORLINK_ST_REG_MAX_APP_SPEED:
      return 4000;
    default:
      return fan->values[reg];
  }
}

/* From now on to another speed. */
static void go(struct fan *fan, int32_t speed_rpm, uint16_t duration_ms) {
  fan->from_rpm = speed(fan);
  fan->to_rpm = speed_rpm;
  fan->length_us = (uint64_t)duration_ms * 1000U;
  fan->began_us = now_us();
}

static motorlink_st_error_code write_register(void *context, uint8_t motor, motorlink_st_reg reg,
                                              int32_t value) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  if (reg == MOTORLINK_ST_REG_CONTROL_MODE && value > MOTORLINK_ST_CONTROL_MODE_SPEED) {
    return MOTORLINK_ST_ERROR_CODE_NONE; /* taken, and changes nothing */
  }
  fan->values[reg] = value;
  if (reg == MOTORLINK_ST_REG_RAMP_FINAL_SPEED) {
    go(fan, value, 0);
  } else if (reg == MOTORLINK_ST_REG_IQ_SPEEDMODE) {
    fan->values[MOTORLINK_ST_REG_FLUX_REF] = value;
  }
  return MOTORLINK_ST_ERROR_CODE_NONE;
}

/* A ramp begins when the motor does. */
static void start(struct fan *fan, int running) {
  if (running && !fan->running) {
    fan->from_rpm = 0;
    fan->began_us = now_us();
  }
  fan->running = running;
}

static void execute(void *context, uint8_t motor, motorlink_st_command command) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  switch (command) {
    case MOTORLINK_ST_COMMAND_START_MOTOR:
      start(fan, 1);
      break;
    case MOTORLINK_ST_COMMAND_STOP_MOTOR:
      start(fan, 0);
      break;
    case MOTORLINK_ST_COMMAND_IQDREF_CLEAR:
      fan->values[MOTORLINK_ST_REG_TORQUE_REF] = 0;
      fan->values[MOTORLINK_ST_REG_FLUX_REF] = 0;
      break;
    case MOTORLINK_ST_COMMAND_STOP_RAMP:
      go(fan, speed(fan), 0);
      break;
    case MOTORLINK_ST_COMMAND_START_STOP:
      start(fan, !fan->running);
      break;
    default:
      break;
  }
}

static void ramp(void *context, uint8_t motor, int32_t speed_rpm, uint16_t duration_ms) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  fan->values[MOTORLINK_ST_REG_CONTROL_MODE] = MOTORLINK_ST_CONTROL_MODE_SPEED;
  go(fan, speed_rpm, duration_ms);
}

static void current(void *context, uint8_t motor, int16_t iq_s16a, int16_t id_s16a) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  fan->values[MOTORLINK_ST_REG_TORQUE_REF] = iq_s16a;
  fan->values[MOTORLINK_ST_REG_FLUX_REF] = id_s16a;
}

static void revup(void *context, uint8_t motor, uint8_t phase, motorlink_st_revup_phase *data) {
  (void)motor;
  *data = ((const struct fan *)context)->revup[phase];
}

static void set_revup(void *context, uint8_t motor, uint8_t phase,
                      const motorlink_st_revup_phase *data) {
  (void)motor;
  ((struct fan *)context)->revup[phase] = *data;
}

/* The table of callbacks for the slave. */
static motorlink_st_motor_control fan_control(struct fan *fan) {
  motorlink_st_motor_control drive;
  memset(&drive, 0, sizeof drive);
  drive.context = fan;
  drive.version.name = "Fan in C";
  drive.version.major = 1;
  drive.version.minor = 2;
  drive.get_register = read_register;
  drive.set_register = write_register;
  drive.execute = execute;
  drive.set_ramp = ramp;
  drive.get_revup_data = revup;
  drive.set_revup_data = set_revup;
  drive.set_current_reference = current;
  return drive;
}

#endif
