/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Written by `make header` from the table of RMD commands: do not edit. */
#ifndef MOTORLINK_TEST_RMD_COMMANDS_H
#define MOTORLINK_TEST_RMD_COMMANDS_H

#include "vectors.h"

static motorlink_rmd_pid pid_of(const json_t *f) {
  motorlink_rmd_pid values;
  values.position_kp = (uint8_t)number(f, "position_kp");
  values.position_ki = (uint8_t)number(f, "position_ki");
  values.speed_kp = (uint8_t)number(f, "speed_kp");
  values.speed_ki = (uint8_t)number(f, "speed_ki");
  values.torque_kp = (uint8_t)number(f, "torque_kp");
  values.torque_ki = (uint8_t)number(f, "torque_ki");
  return values;
}

/* The request that a vector's fields describe. */
static motorlink_rmd_data request_of(uint8_t command, const json_t *f) {
  switch (command) {
    case MOTORLINK_RMD_CODE_READ_PID:
      return motorlink_rmd_read_pid();
    case MOTORLINK_RMD_CODE_WRITE_PID_RAM:
      return motorlink_rmd_write_pid_ram(pid_of(f));
    case MOTORLINK_RMD_CODE_WRITE_PID_ROM:
      return motorlink_rmd_write_pid_rom(pid_of(f));
    case MOTORLINK_RMD_CODE_READ_ACCELERATION:
      return motorlink_rmd_read_acceleration();
    case MOTORLINK_RMD_CODE_WRITE_ACCELERATION_RAM:
      return motorlink_rmd_write_acceleration_ram((int32_t)number(f, "acceleration"));
    case MOTORLINK_RMD_CODE_READ_ENCODER:
      return motorlink_rmd_read_encoder();
    case MOTORLINK_RMD_CODE_WRITE_ENCODER_OFFSET_ROM:
      return motorlink_rmd_write_encoder_offset_rom((uint16_t)number(f, "offset"));
    case MOTORLINK_RMD_CODE_WRITE_ZERO_ROM:
      return motorlink_rmd_write_zero_rom();
    case MOTORLINK_RMD_CODE_READ_MULTI_TURN_ANGLE:
      return motorlink_rmd_read_multi_turn_angle();
    case MOTORLINK_RMD_CODE_READ_SINGLE_TURN_ANGLE:
      return motorlink_rmd_read_single_turn_angle();
    case MOTORLINK_RMD_CODE_READ_STATUS:
      return motorlink_rmd_read_status();
    case MOTORLINK_RMD_CODE_CLEAR_ERRORS:
      return motorlink_rmd_clear_errors();
    case MOTORLINK_RMD_CODE_READ_MOTION_STATUS:
      return motorlink_rmd_read_motion_status();
    case MOTORLINK_RMD_CODE_READ_PHASE_CURRENTS:
      return motorlink_rmd_read_phase_currents();
    case MOTORLINK_RMD_CODE_OFF:
      return motorlink_rmd_off();
    case MOTORLINK_RMD_CODE_STOP:
      return motorlink_rmd_stop();
    case MOTORLINK_RMD_CODE_RUN:
      return motorlink_rmd_run();
    case MOTORLINK_RMD_CODE_SET_TORQUE:
      return motorlink_rmd_set_torque((int16_t)number(f, "iq"));
    case MOTORLINK_RMD_CODE_SET_SPEED:
      return motorlink_rmd_set_speed((int32_t)number(f, "speed"));
    case MOTORLINK_RMD_CODE_SET_POSITION:
      return motorlink_rmd_set_position((int32_t)number(f, "angle"));
    case MOTORLINK_RMD_CODE_SET_POSITION_LIMITED:
      return motorlink_rmd_set_position_limited((int32_t)number(f, "angle"), (uint16_t)number(f, "max_speed"));
    case MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION:
      return motorlink_rmd_set_single_turn_position((motorlink_rmd_spin_direction)number(f, "direction"), (uint16_t)number(f, "angle"));
    case MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION_LIMITED:
      return motorlink_rmd_set_single_turn_position_limited((motorlink_rmd_spin_direction)number(f, "direction"), (uint16_t)number(f, "angle"), (uint16_t)number(f, "max_speed"));
    default:
      (void)f;
      CHECK(!"a command");
      return motorlink_rmd_off();
  }
}

/* What is read from a reply is what its fields say. */
static void decoded(uint8_t command, motorlink_rmd_data reply, const json_t *f) {
  switch (command) {
    case MOTORLINK_RMD_CODE_READ_PID:
    case MOTORLINK_RMD_CODE_WRITE_PID_RAM:
    case MOTORLINK_RMD_CODE_WRITE_PID_ROM:
    {
      motorlink_rmd_pid read;
      OK(motorlink_rmd_decode_pid(reply, &read));
      CHECK(read.position_kp == number(f, "position_kp"));
      CHECK(read.position_ki == number(f, "position_ki"));
      CHECK(read.speed_kp == number(f, "speed_kp"));
      CHECK(read.speed_ki == number(f, "speed_ki"));
      CHECK(read.torque_kp == number(f, "torque_kp"));
      CHECK(read.torque_ki == number(f, "torque_ki"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_ACCELERATION:
    case MOTORLINK_RMD_CODE_WRITE_ACCELERATION_RAM:
    {
      int32_t read;
      OK(motorlink_rmd_decode_acceleration(reply, &read));
      CHECK(read == number(f, "acceleration"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_ENCODER:
    {
      motorlink_rmd_encoder read;
      OK(motorlink_rmd_decode_encoder(reply, &read));
      CHECK(read.position == number(f, "position"));
      CHECK(read.raw == number(f, "raw"));
      CHECK(read.offset == number(f, "offset"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_MULTI_TURN_ANGLE:
    {
      int64_t read;
      OK(motorlink_rmd_decode_multi_turn_angle(reply, &read));
      CHECK(read == number(f, "angle"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_SINGLE_TURN_ANGLE:
    {
      uint16_t read;
      OK(motorlink_rmd_decode_single_turn_angle(reply, &read));
      CHECK(read == number(f, "angle"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_STATUS:
    case MOTORLINK_RMD_CODE_CLEAR_ERRORS:
    {
      motorlink_rmd_status read;
      OK(motorlink_rmd_decode_status(reply, &read));
      CHECK(read.voltage_decivolts == number(f, "voltage"));
      CHECK(read.temperature_celsius == number(f, "temperature"));
      CHECK(read.errors == number(f, "errors"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_MOTION_STATUS:
    case MOTORLINK_RMD_CODE_SET_TORQUE:
    case MOTORLINK_RMD_CODE_SET_SPEED:
    case MOTORLINK_RMD_CODE_SET_POSITION:
    case MOTORLINK_RMD_CODE_SET_POSITION_LIMITED:
    case MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION:
    case MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION_LIMITED:
    {
      motorlink_rmd_motion_status read;
      OK(motorlink_rmd_decode_motion_status(reply, &read));
      CHECK(read.iq_digits == number(f, "iq"));
      CHECK(read.speed_dps == number(f, "speed"));
      CHECK(read.encoder == number(f, "encoder"));
      CHECK(read.temperature_celsius == number(f, "temperature"));
      break;
    }
    case MOTORLINK_RMD_CODE_READ_PHASE_CURRENTS:
    {
      motorlink_rmd_phase_currents read;
      OK(motorlink_rmd_decode_phase_currents(reply, &read));
      CHECK(read.phase_a_digits == number(f, "phase_a"));
      CHECK(read.phase_b_digits == number(f, "phase_b"));
      CHECK(read.phase_c_digits == number(f, "phase_c"));
      break;
    }
    case MOTORLINK_RMD_CODE_WRITE_ENCODER_OFFSET_ROM:
    case MOTORLINK_RMD_CODE_WRITE_ZERO_ROM:
    {
      uint16_t read;
      OK(motorlink_rmd_decode_encoder_offset(reply, &read));
      CHECK(read == number(f, "offset"));
      break;
    }
    default:
      CHECK(json_object_size(f) == 0);
  }
}

static int is_repeated(uint8_t command) {
  switch (command) {
    case MOTORLINK_RMD_CODE_WRITE_PID_RAM:
    case MOTORLINK_RMD_CODE_WRITE_PID_ROM:
    case MOTORLINK_RMD_CODE_WRITE_ACCELERATION_RAM:
    case MOTORLINK_RMD_CODE_OFF:
    case MOTORLINK_RMD_CODE_STOP:
    case MOTORLINK_RMD_CODE_RUN:
      return 1;
    default:
      return 0;
  }
}

#endif
