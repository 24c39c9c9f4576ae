/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What exceeds a limit of a master is never sent. proto tests which requests that are. */
#include "check.h"

static motorlink_st_master master;
static const uint8_t acknowledge[3] = {0xF0, 0x00, 0xF0};
static const uint8_t refusal[4] = {0xFF, 0x01, 0x05, 0x06};

static void limit(int32_t speed_rpm, int32_t current_s16a) {
  motorlink_st_limits limits;
  limits.speed_rpm = speed_rpm;
  limits.current_s16a = current_s16a;
  OK(motorlink_st_master_set_limits(&master, &limits));
}

static void begin(motorlink_st_profile profile, int32_t speed_rpm, int32_t current_s16a) {
  motorlink_st_master_config config = motorlink_st_master_defaults();
  config.profile = profile;
  OK(motorlink_st_master_init(&master, sizeof master, &config));
  OK(motorlink_st_master_trust_line(&master));
  limit(speed_rpm, current_s16a);
}

static motorlink_st_output next(motorlink_output kind) {
  motorlink_st_output output;
  OK(motorlink_st_master_poll(&master, 0, &output));
  CHECK(output.kind == kind);
  return output;
}

/* The request is refused, and nothing is to be sent. */
static void exceeds(motorlink_error begun) {
  CHECK(begun == MOTORLINK_ERROR_LIMIT);
  CHECK(next(MOTORLINK_OUTPUT_WAIT).until_us == MOTORLINK_NEVER);
}

/* The request is sent, and the drive answers this. */
static motorlink_error answered(motorlink_error begun, const uint8_t *reply, size_t size) {
  OK(begun);
  next(MOTORLINK_OUTPUT_TRANSMIT);
  OK(motorlink_st_master_receive(&master, 0, reply, size));
  return next(MOTORLINK_OUTPUT_DONE).result;
}

static void done(motorlink_error begun) {
  OK(answered(begun, acknowledge, sizeof acknowledge));
}

static motorlink_error start(uint8_t motor) {
  return motorlink_st_master_execute(&master, motor, MOTORLINK_ST_COMMAND_START_MOTOR);
}

static motorlink_error ramp(uint8_t motor, int32_t speed_rpm) {
  return motorlink_st_master_set_ramp(&master, motor, speed_rpm, 100);
}

static motorlink_error raw(motorlink_st_frame_code code, const uint8_t *payload, size_t size) {
  return motorlink_st_master_raw(&master, 1, code, payload, size);
}

static void values(void) {
  const uint8_t over[6] = {0xE9, 0x03, 0, 0, 0, 0};
  subject = "speed";
  begin(MOTORLINK_ST_PROFILE_MCSDK54, 1000, MOTORLINK_NO_LIMIT);
  exceeds(ramp(1, 1001));
  exceeds(motorlink_st_master_set_register(&master, 1, MOTORLINK_ST_REG_RAMP_FINAL_SPEED, 1001));
  exceeds(raw(MOTORLINK_ST_FRAME_CODE_SET_RAMP, over, 6));
  done(ramp(1, 1000));
  done(motorlink_st_master_set_current_reference(&master, 1, 501, 0));
  subject = "current";
  begin(MOTORLINK_ST_PROFILE_MCSDK54, MOTORLINK_NO_LIMIT, 500);
  exceeds(motorlink_st_master_set_current_reference(&master, 1, 501, 0));
  done(ramp(1, 100000));
  subject = "none";
  limit(MOTORLINK_NO_LIMIT, MOTORLINK_NO_LIMIT);
  done(motorlink_st_master_set_current_reference(&master, 1, 501, 0));
  done(start(1));
}

/* Under a limit of speed a motor is started behind a ramp only. */
static void starts(void) {
  subject = "start";
  begin(MOTORLINK_ST_PROFILE_SPEC, 1000, MOTORLINK_NO_LIMIT);
  exceeds(start(1));
  exceeds(raw(MOTORLINK_ST_FRAME_CODE_EXECUTE_CMD, acknowledge, 0));
  done(ramp(1, 1000));
  exceeds(start(2));
  done(start(1));
  CHECK(answered(ramp(1, 900), refusal, sizeof refusal) == MOTORLINK_ERROR_REFUSED);
  exceeds(start(1));

  subject = "start on another line, and under another limit";
  done(ramp(1, 1000));
  OK(motorlink_st_master_lost(&master));
  OK(motorlink_st_master_trust_line(&master));
  exceeds(start(1));
  done(ramp(1, 1000));
  OK(motorlink_st_master_reopened(&master));
  OK(motorlink_st_master_trust_line(&master));
  exceeds(start(1));
  done(ramp(1, 1000));
  limit(500, MOTORLINK_NO_LIMIT);
  exceeds(start(1));
}

int main(void) {
  values();
  starts();
  printf("limits: kept\n");
  return 0;
}
