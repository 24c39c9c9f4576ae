/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * What no caller should do, done to every function: it answers with an error and does nothing.
 * Run it where a sanitizer or valgrind watches.
 */
#include <math.h>

#include "every_function.h"

#define GIVES(error, call) CHECK((call) == MOTORLINK_ERROR_##error)

static void ignore_command(void *context, uint8_t motor, motorlink_st_command command) {
  (void)context;
  (void)motor;
  (void)command;
}

static void ignore_motion(void *context, const motorlink_rmd_motion *motion) {
  (void)context;
  (void)motion;
}

/* The callbacks that are required, set by main. */
static motorlink_st_motor_control no_drive;
static motorlink_rmd_motor_control no_motor;

/* Storage for any object, and a byte more. */
static uint64_t memory[MOTORLINK_RMD_HOST_WORDS + 1];

static void wrong_storage(void) {
  const motorlink_rmd_drive_config config = {0, 1, 0, 0};
  unsigned fill;
  subject = "NULL";
  every_object(NULL, MOTORLINK_ERROR_NULL_POINTER);
  subject = "misaligned";
  every_object((unsigned char *)memory + 1, MOTORLINK_ERROR_MISALIGNED);
  every_object((unsigned char *)memory + 4, MOTORLINK_ERROR_MISALIGNED);
  subject = "never initialised";
  for (fill = 0; fill < 256; fill++) {
    memset(memory, (int)fill, sizeof memory);
    every_object(memory, MOTORLINK_ERROR_UNINITIALISED);
  }

  subject = "of another kind";
  OK(motorlink_st_master_init((motorlink_st_master *)memory, sizeof memory, NULL));
  st_slave((motorlink_st_slave *)memory, MOTORLINK_ERROR_WRONG_KIND);
  rmd_host((motorlink_rmd_host *)memory, MOTORLINK_ERROR_WRONG_KIND);
  rmd_drive((motorlink_rmd_drive *)memory, MOTORLINK_ERROR_WRONG_KIND);
  slcan_host((motorlink_slcan_host *)memory, MOTORLINK_ERROR_WRONG_KIND);
  slcan_device((motorlink_slcan_device *)memory, MOTORLINK_ERROR_WRONG_KIND);
  OK(motorlink_st_slave_init((motorlink_st_slave *)memory, sizeof memory,
                             MOTORLINK_ST_PROFILE_SPEC, 1, &no_drive));
  st_master((motorlink_st_master *)memory, MOTORLINK_ERROR_WRONG_KIND);
  OK(motorlink_rmd_host_init((motorlink_rmd_host *)memory, sizeof memory));
  rmd_drive((motorlink_rmd_drive *)memory, MOTORLINK_ERROR_WRONG_KIND);
  OK(motorlink_rmd_drive_init((motorlink_rmd_drive *)memory, sizeof memory, &config, NULL,
                              &no_motor));
  rmd_host((motorlink_rmd_host *)memory, MOTORLINK_ERROR_WRONG_KIND);
  OK(motorlink_slcan_host_init((motorlink_slcan_host *)memory, sizeof memory));
  slcan_device((motorlink_slcan_device *)memory, MOTORLINK_ERROR_WRONG_KIND);
  OK(motorlink_slcan_device_init((motorlink_slcan_device *)memory, sizeof memory));
  slcan_host((motorlink_slcan_host *)memory, MOTORLINK_ERROR_WRONG_KIND);
}

static void wrong_sizes(void) {
  const motorlink_rmd_drive_config config = {0, 1, 0, 0};
  motorlink_st_master master;
  motorlink_st_slave slave;
  motorlink_rmd_host *host = (motorlink_rmd_host *)memory;
  motorlink_rmd_drive drive;
  motorlink_slcan_host adapter;
  motorlink_slcan_device device;
  subject = "too small";
  memset(memory, 0, sizeof memory);
  GIVES(STORAGE_TOO_SMALL, motorlink_st_master_init(&master, sizeof master - 1, NULL));
  GIVES(STORAGE_TOO_SMALL, motorlink_st_slave_init(&slave, sizeof slave - 1,
                                                   MOTORLINK_ST_PROFILE_SPEC, 1, &no_drive));
  GIVES(STORAGE_TOO_SMALL, motorlink_rmd_host_init(host, sizeof *host - 1));
  GIVES(STORAGE_TOO_SMALL,
        motorlink_rmd_drive_init(&drive, sizeof drive - 1, &config, NULL, &no_motor));
  GIVES(STORAGE_TOO_SMALL, motorlink_slcan_host_init(&adapter, sizeof adapter - 1));
  GIVES(STORAGE_TOO_SMALL, motorlink_slcan_device_init(&device, sizeof device - 1));
  GIVES(STORAGE_TOO_SMALL, motorlink_rmd_host_init(host, 0));
  rmd_host(host, MOTORLINK_ERROR_UNINITIALISED);
}

static void wrong_pointers(void) {
  static motorlink_st_master master;
  static motorlink_st_slave slave;
  static motorlink_rmd_host host;
  static motorlink_rmd_drive drive;
  static motorlink_slcan_host adapter;
  static motorlink_slcan_device device;
  unsigned char *odd = (unsigned char *)memory + 1;
  motorlink_rmd_drive_config config = {0, 1, 0, 0};
  motorlink_can_frame frame = frame_of(0x141, 8), other;
  motorlink_slcan_line line;
  motorlink_slcan_answer answer;
  motorlink_st_board_info info;
  motorlink_st_firmware_version version;
  motorlink_st_revup_phase phase;
  const uint8_t bytes[8] = {0};
  const motorlink_st_reg registers[1] = {MOTORLINK_ST_REG_TARGET_MOTOR};
  int32_t value;

  subject = "other pointers";
  GIVES(NULL_POINTER, motorlink_st_master_init(NULL, sizeof master, NULL));
  GIVES(MISALIGNED, motorlink_st_master_init((motorlink_st_master *)(void *)odd, 1000, NULL));
  GIVES(MISALIGNED, motorlink_st_master_init(&master, sizeof master,
                                             (motorlink_st_master_config *)(void *)odd));
  GIVES(NULL_POINTER, motorlink_st_slave_init(NULL, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1, &no_drive));
  GIVES(NULL_POINTER, motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1, NULL));
  GIVES(MISALIGNED, motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1,
                                            (motorlink_st_motor_control *)(void *)odd));
  GIVES(NULL_POINTER, motorlink_rmd_host_init(NULL, sizeof host));
  GIVES(NULL_POINTER, motorlink_rmd_drive_init(NULL, sizeof drive, &config, NULL, &no_motor));
  GIVES(NULL_POINTER, motorlink_rmd_drive_init(&drive, sizeof drive, NULL, NULL, &no_motor));
  GIVES(NULL_POINTER, motorlink_rmd_drive_init(&drive, sizeof drive, &config, NULL, NULL));
  GIVES(MISALIGNED, motorlink_rmd_drive_init(&drive, sizeof drive, &config,
                                             (motorlink_rmd_settings *)(void *)odd, &no_motor));
  GIVES(NULL_POINTER, motorlink_slcan_host_init(NULL, sizeof adapter));
  GIVES(NULL_POINTER, motorlink_slcan_device_init(NULL, sizeof device));

  OK(motorlink_st_master_init(&master, sizeof master, NULL));
  OK(motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1, &no_drive));
  OK(motorlink_rmd_host_init(&host, sizeof host));
  OK(motorlink_rmd_drive_init(&drive, sizeof drive, &config, NULL, &no_motor));
  OK(motorlink_slcan_host_init(&adapter, sizeof adapter));
  OK(motorlink_slcan_device_init(&device, sizeof device));

  GIVES(NULL_POINTER, motorlink_st_master_set_revup_data(&master, 1, 0, NULL));
  GIVES(NULL_POINTER, motorlink_st_master_configure_segment(&master, 1, 0, NULL, 1));
  GIVES(NULL_POINTER, motorlink_st_master_get_profiler_info(&master, 1, NULL, 1));
  GIVES(NULL_POINTER, motorlink_st_master_raw(&master, 0, MOTORLINK_ST_FRAME_CODE_SET_REG, NULL, 1));
  GIVES(NULL_POINTER, motorlink_st_master_poll(&master, 0, NULL));
  GIVES(NULL_POINTER, motorlink_st_master_receive(&master, 0, NULL, 1));
  GIVES(NULL_POINTER, motorlink_st_master_is_lost(&master, NULL));
  GIVES(NULL_POINTER, motorlink_st_master_set_limits(&master, NULL));
  GIVES(MISALIGNED, motorlink_st_master_poll(&master, 0, (motorlink_st_output *)(void *)odd));
  OK(motorlink_st_master_receive(&master, 0, NULL, 0));
  OK(motorlink_st_master_raw(&master, 0, MOTORLINK_ST_FRAME_CODE_SET_REG, NULL, 0));
  GIVES(NULL_POINTER, motorlink_st_slave_receive(&slave, 0, 0, NULL));
  GIVES(NULL_POINTER, motorlink_st_slave_poll(&slave, 0, NULL));
  GIVES(NULL_POINTER, motorlink_st_slave_deadline(&slave, NULL));
  GIVES(NULL_POINTER, motorlink_st_slave_overrun(&slave, NULL));
  GIVES(NULL_POINTER, motorlink_st_decode_board_info(NULL, 8, &info));
  GIVES(NULL_POINTER, motorlink_st_decode_board_info(bytes, 8, NULL));
  GIVES(NULL_POINTER, motorlink_st_decode_firmware_version(NULL, 8, &version));
  GIVES(NULL_POINTER, motorlink_st_decode_firmware_version(bytes, 8, NULL));
  GIVES(NULL_POINTER, motorlink_st_decode_revup_data(NULL, 8, &phase));
  GIVES(NULL_POINTER, motorlink_st_decode_revup_data(bytes, 8, NULL));
  GIVES(NULL_POINTER, motorlink_st_decode_segment(NULL, 1, registers, 1, &value));
  GIVES(NULL_POINTER, motorlink_st_decode_segment(bytes, 1, NULL, 1, &value));
  GIVES(NULL_POINTER, motorlink_st_decode_segment(bytes, 1, registers, 1, NULL));
  GIVES(MISALIGNED, motorlink_st_decode_segment(bytes, 1, registers, 1, (int32_t *)(void *)odd));
  OK(motorlink_st_decode_segment(NULL, 0, NULL, 0, NULL));

  GIVES(NULL_POINTER, motorlink_rmd_decode_pid(motorlink_rmd_read_pid(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_acceleration(motorlink_rmd_read_acceleration(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_encoder(motorlink_rmd_read_encoder(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_multi_turn_angle(motorlink_rmd_read_multi_turn_angle(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_single_turn_angle(motorlink_rmd_read_single_turn_angle(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_status(motorlink_rmd_read_status(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_motion_status(motorlink_rmd_read_motion_status(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_phase_currents(motorlink_rmd_read_phase_currents(), NULL));
  GIVES(NULL_POINTER, motorlink_rmd_decode_encoder_offset(motorlink_rmd_write_zero_rom(), NULL));

  GIVES(NULL_POINTER, motorlink_rmd_host_set_limits(&host, 1, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_host_set_torque4(&host, 0, NULL, 0));
  GIVES(MISALIGNED, motorlink_rmd_host_set_torque4(&host, 0, (int16_t *)(void *)odd, 0));
  GIVES(NULL_POINTER, motorlink_rmd_host_retry(&host, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_host_poll(&host, 0, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_host_receive(&host, 0, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_host_busy(&host, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_drive_receive(&drive, 0, NULL, &other));
  GIVES(NULL_POINTER, motorlink_rmd_drive_receive(&drive, 0, &frame, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_drive_deadline(&drive, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_drive_motion(&drive, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_drive_errors(&drive, NULL));
  GIVES(NULL_POINTER, motorlink_rmd_drive_settings(&drive, NULL));

  GIVES(NULL_POINTER, motorlink_slcan_host_receive(&adapter, 0, NULL, &other));
  GIVES(NULL_POINTER, motorlink_slcan_host_receive(&adapter, 0, &answer, NULL));
  GIVES(NULL_POINTER, motorlink_slcan_open(1000000, NULL));
  GIVES(NULL_POINTER, motorlink_slcan_encode(NULL, &line));
  GIVES(NULL_POINTER, motorlink_slcan_encode(&frame, NULL));
  GIVES(NULL_POINTER, motorlink_slcan_device_receive(&device, 0, NULL, &other));
  GIVES(NULL_POINTER, motorlink_slcan_device_receive(&device, 0, &line, NULL));
  GIVES(NULL_POINTER, motorlink_slcan_device_deliver(&device, 0, NULL, &line));
  GIVES(NULL_POINTER, motorlink_slcan_device_deliver(&device, 0, &frame, NULL));
}

static int named(motorlink_bytes name, const char *expected) {
  return name.size == strlen(expected) && memcmp(name.data, expected, name.size) == 0;
}

static void wrong_numbers(void) {
  static motorlink_st_master master;
  static motorlink_st_slave slave;
  static motorlink_rmd_host host;
  static motorlink_rmd_drive drive;
  const uint8_t bytes[130] = {0};
  const motorlink_rmd_spin_direction unnamed_direction = (motorlink_rmd_spin_direction)7;
  const motorlink_st_reg unnamed[1] = {(motorlink_st_reg)255};
  static const motorlink_st_reg registers[128] = {MOTORLINK_ST_REG_TARGET_MOTOR};
  int32_t value;
  const int16_t torques[4] = {0, 0, 0, 2001};
  const motorlink_st_revup_phase phase = {0, 0, 0};
  motorlink_st_master_config config = motorlink_st_master_defaults();
  motorlink_st_limits st_limits = {0, 0};
  motorlink_rmd_drive_config drive_config = {0, 1, 0, 0};
  motorlink_rmd_limits limits = {MOTORLINK_NO_LIMIT, MOTORLINK_NO_LIMIT,
                                 MOTORLINK_NO_LIMIT};
  motorlink_can_frame frame, reply;
  motorlink_st_board_info info;
  motorlink_st_revup_phase read;
  motorlink_slcan_line line;
  motorlink_st_output output;

  subject = "numbers";
  CHECK(sizeof(motorlink_st_reg) == 1 && sizeof config.profile == 1 && sizeof output.error_code == 1);
  OK(motorlink_st_master_init(&master, sizeof master, NULL));
  GIVES(BAD_ARGUMENT, motorlink_st_master_get_register(&master, 8, MOTORLINK_ST_REG_STATUS));
  GIVES(BAD_ARGUMENT, motorlink_st_master_set_register(&master, 9, MOTORLINK_ST_REG_SPEED_KP, 0));
  GIVES(BAD_ARGUMENT, motorlink_st_master_execute(&master, 255, MOTORLINK_ST_COMMAND_STOP_MOTOR));
  GIVES(BAD_ARGUMENT, motorlink_st_master_get_revup_data(&master, 1, 5));
  GIVES(BAD_ARGUMENT, motorlink_st_master_set_revup_data(&master, 1, 255, &phase));
  GIVES(BAD_ARGUMENT, motorlink_st_master_set_position(&master, 1, (float)HUGE_VAL, 1));
  GIVES(BAD_ARGUMENT, motorlink_st_master_set_position(&master, 1, 1, (float)-HUGE_VAL));
  GIVES(TOO_LONG, motorlink_st_master_raw(&master, 0, MOTORLINK_ST_FRAME_CODE_SET_REG, bytes, 129));
  GIVES(BAD_ARGUMENT, motorlink_st_master_raw(&master, 8, MOTORLINK_ST_FRAME_CODE_SET_REG, bytes, 1));
  GIVES(BAD_ARGUMENT, motorlink_st_master_raw(&master, 1, (motorlink_st_frame_code)32, bytes, 1));
  GIVES(TOO_LONG, motorlink_st_master_configure_segment(&master, 1, 0, registers, 128));
  GIVES(TOO_LONG, motorlink_st_master_get_profiler_info(&master, 1, bytes, 129));
  GIVES(BAD_ARGUMENT, motorlink_st_master_raw(&master, 0, MOTORLINK_ST_FRAME_CODE_SET_REG, bytes, SIZE_MAX));
  GIVES(BAD_ARGUMENT, motorlink_st_master_receive(&master, 0, bytes, SIZE_MAX / 2 + 1));
  /* Nothing of this began an exchange. */
  OK(motorlink_st_master_poll(&master, 0, &output));
  CHECK(output.kind == MOTORLINK_OUTPUT_WAIT && output.until_us == MOTORLINK_NEVER);
  OK(motorlink_st_master_get_board_info(&master, 7));
  GIVES(BUSY, motorlink_st_master_execute(&master, 1, MOTORLINK_ST_COMMAND_STOP_MOTOR));
  GIVES(BUSY, motorlink_st_master_raw(&master, 0, MOTORLINK_ST_FRAME_CODE_SET_REG, bytes, 1));
  config.profile = (motorlink_st_profile)2;
  GIVES(BAD_ARGUMENT, motorlink_st_master_init(&master, sizeof master, &config));
  config.profile = MOTORLINK_ST_PROFILE_MCSDK54;
  config.recovery = (motorlink_st_recovery)3;
  GIVES(BAD_ARGUMENT, motorlink_st_master_init(&master, sizeof master, &config));
  GIVES(BAD_ARGUMENT, motorlink_st_slave_init(&slave, sizeof slave, (motorlink_st_profile)2, 1, &no_drive));
  GIVES(BAD_ARGUMENT, motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 0, &no_drive));
  GIVES(BAD_ARGUMENT, motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 8, &no_drive));
  st_slave(&slave, MOTORLINK_ERROR_UNINITIALISED);
  GIVES(BAD_ARGUMENT, motorlink_st_decode_board_info(bytes, 2, &info));
  GIVES(BAD_ARGUMENT, motorlink_st_decode_revup_data(bytes, 7, &read));
  GIVES(BAD_ARGUMENT, motorlink_st_decode_segment(bytes, 2, registers, 1, &value));
  GIVES(BAD_ARGUMENT, motorlink_st_decode_segment(bytes, 1, unnamed, 1, &value));
  GIVES(BAD_ARGUMENT, motorlink_st_decode_segment(bytes, 8, registers, SIZE_MAX, &value));
  GIVES(BAD_ARGUMENT, motorlink_st_check_value((motorlink_st_profile)2, MOTORLINK_ST_REG_HEATS_TEMP, 25));
  GIVES(IMPLAUSIBLE, motorlink_st_check_value(MOTORLINK_ST_PROFILE_SPEC, MOTORLINK_ST_REG_HEATS_TEMP, 65526));
  OK(motorlink_st_check_value(MOTORLINK_ST_PROFILE_MCSDK54, MOTORLINK_ST_REG_HEATS_TEMP, -10));
  OK(motorlink_st_check_value(MOTORLINK_ST_PROFILE_SPEC, unnamed[0], INT32_MIN));
  CHECK(motorlink_st_reg_name(unnamed[0]).size == 0 && motorlink_st_reg_name(unnamed[0]).data != NULL);
  CHECK(named(motorlink_st_reg_name(MOTORLINK_ST_REG_SPEED_MEAS), "SPEED_MEAS"));
  CHECK(named(motorlink_st_reg_unit(MOTORLINK_ST_PROFILE_SPEC, MOTORLINK_ST_REG_SPEED_MEAS), "rpm"));
  CHECK(named(motorlink_st_error_code_name(MOTORLINK_ST_ERROR_CODE_WRONG_SET), "WRONG_SET"));
  CHECK(named(motorlink_st_status_name(MOTORLINK_ST_STATUS_RUN), "RUN"));
  CHECK(named(motorlink_st_command_name(MOTORLINK_ST_COMMAND_FAULT_ACK), "FAULT_ACK"));

  config = motorlink_st_master_defaults();
  OK(motorlink_st_master_init(&master, sizeof master, &config));
  OK(motorlink_st_master_get_register(&master, 1, MOTORLINK_ST_REG_STATUS));
  OK(motorlink_st_master_poll(&master, 0, &output));
  CHECK(output.kind == MOTORLINK_OUTPUT_WAIT && output.until_us == config.quiet_us);
  config.baud = 9600;
  OK(motorlink_st_master_init(&master, sizeof master, &config));
  OK(motorlink_st_master_get_register(&master, 1, MOTORLINK_ST_REG_STATUS));
  OK(motorlink_st_master_poll(&master, 0, &output));
  /* The longest frame and a byte, with 10 bits each. */
  CHECK(output.kind == MOTORLINK_OUTPUT_WAIT && output.until_us == config.quiet_us + 137500U);
  st_limits.speed_rpm = -2;
  GIVES(BAD_ARGUMENT, motorlink_st_master_set_limits(&master, &st_limits));
  st_limits.speed_rpm = INT32_MAX;
  st_limits.current_s16a = 65536;
  GIVES(BAD_ARGUMENT, motorlink_st_master_set_limits(&master, &st_limits));
  st_limits.current_s16a = 65535;
  OK(motorlink_st_master_set_limits(&master, &st_limits));

  OK(motorlink_rmd_host_init(&host, sizeof host));
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_request(&host, 0, 0, motorlink_rmd_off()));
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_request(&host, 0, 33, motorlink_rmd_off()));
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_cancel(&host, 0, 33));
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_confirm(&host, 0, 33));
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_set_torque4(&host, 0, torques, 0x10));
  GIVES(LIMIT, motorlink_rmd_host_set_torque4(&host, 0, torques, 0x0F));
  GIVES(LIMIT, motorlink_rmd_host_request(&host, 0, 1, motorlink_rmd_set_torque(-2001)));
  GIVES(LIMIT, motorlink_rmd_host_request(&host, 0, 1,
                                          motorlink_rmd_set_single_turn_position(unnamed_direction, 0)));
  limits.current_16ma = 32768;
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_set_limits(&host, 1, &limits));
  limits.current_16ma = -2;
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_set_limits(&host, 1, &limits));
  limits.current_16ma = MOTORLINK_NO_LIMIT;
  limits.speed_dps = 65536;
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_set_limits(&host, 1, &limits));
  limits.speed_dps = 100;
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_set_limits(&host, 33, &limits));
  OK(motorlink_rmd_host_set_limits(&host, 1, &limits));
  GIVES(LIMIT, motorlink_rmd_host_request(&host, 0, 1, motorlink_rmd_set_speed(10001)));
  OK(motorlink_rmd_host_request(&host, 0, 1, motorlink_rmd_set_speed(10000)));
  GIVES(BUSY, motorlink_rmd_host_request(&host, 0, 1, motorlink_rmd_off()));

  OK(motorlink_rmd_drive_init(&drive, sizeof drive, &drive_config, NULL, &no_motor));
  OK(motorlink_rmd_drive_power_on(&drive, 0));
  frame = frame_of(0x141, 9);
  GIVES(BAD_ARGUMENT, motorlink_rmd_drive_receive(&drive, 0, &frame, &reply));
  GIVES(BAD_ARGUMENT, motorlink_rmd_host_receive(&host, 0, &frame));
  GIVES(BAD_ARGUMENT, motorlink_slcan_encode(&frame, &line));
  frame = frame_of(0x800, 8);
  GIVES(BAD_ARGUMENT, motorlink_rmd_drive_receive(&drive, 0, &frame, &reply));
  frame.extended = 255;
  OK(motorlink_rmd_drive_receive(&drive, 0, &frame, &reply));
  CHECK(reply.id == MOTORLINK_NO_FRAME && reply.size == 0);
  GIVES(BAD_ARGUMENT, motorlink_rmd_drive_receive(&drive, 0, &reply, &frame));
  GIVES(BAD_ARGUMENT, motorlink_slcan_open(123, &line));
  drive_config.id = 33;
  GIVES(BAD_ARGUMENT,
        motorlink_rmd_drive_init(&drive, sizeof drive, &drive_config, NULL, &no_motor));
  drive_config.id = 1;
  drive_config.encoder_bits = 19;
  GIVES(BAD_ARGUMENT,
        motorlink_rmd_drive_init(&drive, sizeof drive, &drive_config, NULL, &no_motor));

  CHECK(motorlink_rmd_encoder_centidegrees(0x1000, 14) == 9000);
  CHECK(motorlink_rmd_encoder_centidegrees(0x1000, 11) == 0);
  CHECK(strcmp(motorlink_error_text(-1), motorlink_error_text(1000)) == 0);
  CHECK(strcmp(motorlink_error_text(MOTORLINK_OK), "done") == 0);
}

/* Callbacks that call for the object that calls them. */

static motorlink_st_slave calling_slave;
static motorlink_rmd_drive calling_drive;
static int called;

static void from_the_slave(void) {
  st_slave(&calling_slave, MOTORLINK_ERROR_IN_USE);
  st_master((motorlink_st_master *)&calling_slave, MOTORLINK_ERROR_WRONG_KIND);
  called++;
}

static uint16_t features(void *context, uint8_t motor) {
  (void)context;
  (void)motor;
  from_the_slave();
  return MOTORLINK_ST_FEATURE_PFC;
}

static int32_t read_register(void *context, uint8_t motor, motorlink_st_reg reg) {
  (void)context;
  (void)motor;
  (void)reg;
  from_the_slave();
  return 42;
}

static void from_the_drive(void) {
  rmd_drive(&calling_drive, MOTORLINK_ERROR_IN_USE);
  called++;
}

static void set_mode(void *context, const motorlink_rmd_motion *motion) {
  (void)context;
  (void)motion;
  from_the_drive();
}

static void configure(void *context, const motorlink_rmd_settings *settings) {
  (void)context;
  (void)settings;
  from_the_drive();
}

static void sense(void *context, motorlink_rmd_sense *sense_out) {
  (void)context;
  (void)sense_out;
  from_the_drive();
}

static void reentered(void) {
  static motorlink_st_motor_control drive;
  static motorlink_rmd_motor_control motor;
  const uint8_t get[4] = {0x22, 0x01, 0x02, 0x25};
  const uint8_t answered[4] = {0xF0, 0x01, 42, 0x1C};
  const motorlink_rmd_drive_config config = {0, 1, 0, 0};
  motorlink_can_frame frame = frame_of(0x141, 8), reply;
  motorlink_bytes sent;
  size_t at;

  subject = "called from a callback";
  drive.execute = ignore_command;
  drive.features = features;
  drive.get_register = read_register;
  OK(motorlink_st_slave_init(&calling_slave, sizeof calling_slave, MOTORLINK_ST_PROFILE_SPEC, 1, &drive));
  for (at = 0; at < sizeof get; at++) {
    OK(motorlink_st_slave_receive(&calling_slave, 0, get[at], &sent));
  }
  CHECK(called >= 2);
  CHECK(sent.size == sizeof answered && memcmp(sent.data, answered, sent.size) == 0);

  called = 0;
  motor.set_mode = set_mode;
  motor.configure = configure;
  motor.sense = sense;
  OK(motorlink_rmd_drive_init(&calling_drive, sizeof calling_drive, &config, NULL, &motor));
  OK(motorlink_rmd_drive_power_on(&calling_drive, 0));
  CHECK(called == 2);
  memcpy(frame.data, motorlink_rmd_set_torque(5).bytes, sizeof frame.data);
  OK(motorlink_rmd_drive_receive(&calling_drive, 0, &frame, &reply));
  CHECK(called >= 4 && reply.size == 8);
  OK(motorlink_rmd_drive_poll(&calling_drive, 0));
}

/* Objects are plain data: a copy is an object of its own. */
static void copied(void) {
  motorlink_st_master one, two;
  motorlink_st_output output;
  subject = "copies";
  OK(motorlink_st_master_init(&one, sizeof one, NULL));
  OK(motorlink_st_master_trust_line(&one));
  two = one;
  OK(motorlink_st_master_get_board_info(&one, 0));
  OK(motorlink_st_master_poll(&two, 0, &output));
  CHECK(output.kind == MOTORLINK_OUTPUT_WAIT);
  OK(motorlink_st_master_poll(&one, 0, &output));
  CHECK(output.kind == MOTORLINK_OUTPUT_TRANSMIT && output.bytes.size == 3);
}

static void versions(void) {
  char numbers[32];
  subject = "version";
  CHECK(strcmp(motorlink_version(), MOTORLINK_VERSION) == 0);
  sprintf(numbers, "%d.%d.%d", MOTORLINK_VERSION_MAJOR, MOTORLINK_VERSION_MINOR,
          MOTORLINK_VERSION_PATCH);
  CHECK(strcmp(numbers, MOTORLINK_VERSION) == 0);
}

int main(void) {
  no_drive.execute = ignore_command;
  no_motor.set_mode = ignore_motion;
  versions();
  wrong_storage();
  wrong_sizes();
  wrong_pointers();
  wrong_numbers();
  reentered();
  copied();
  printf("robustness: %d times every function of an object refused\n", groups);
  return 0;
}
