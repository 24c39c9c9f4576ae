/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Every function of an object finds the same wrong with its storage. */
#ifndef MOTORLINK_EVERY_FUNCTION_H
#define MOTORLINK_EVERY_FUNCTION_H

#include "check.h"

#define REFUSED(call) CHECK((call) == expected)

static int groups;

static motorlink_can_frame frame_of(uint32_t id, uint8_t size) {
  motorlink_can_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.id = id;
  frame.size = size;
  return frame;
}

static void st_master(motorlink_st_master *master, motorlink_error expected) {
  const motorlink_st_revup_phase phase = {0, 0, 0};
  const uint8_t bytes[4] = {1, 2, 3, 4};
  const motorlink_st_reg registers[1] = {MOTORLINK_ST_REG_STATUS};
  const motorlink_st_limits limits = {MOTORLINK_NO_LIMIT, 1};
  motorlink_st_output output;
  uint8_t lost;
  REFUSED(motorlink_st_master_set_limits(master, &limits));
  REFUSED(motorlink_st_master_get_register(master, 1, MOTORLINK_ST_REG_STATUS));
  REFUSED(motorlink_st_master_set_register(master, 1, MOTORLINK_ST_REG_SPEED_KP, 1));
  REFUSED(motorlink_st_master_execute(master, 1, MOTORLINK_ST_COMMAND_STOP_MOTOR));
  REFUSED(motorlink_st_master_set_ramp(master, 1, 0, 0));
  REFUSED(motorlink_st_master_set_current_reference(master, 1, 0, 0));
  REFUSED(motorlink_st_master_set_torque_ramp(master, 1, 0, 0));
  REFUSED(motorlink_st_master_set_position(master, 1, 0, 0));
  REFUSED(motorlink_st_master_get_revup_data(master, 1, 0));
  REFUSED(motorlink_st_master_set_revup_data(master, 1, 0, &phase));
  REFUSED(motorlink_st_master_get_board_info(master, 1));
  REFUSED(motorlink_st_master_get_firmware_version(master, 1));
  REFUSED(motorlink_st_master_configure_segment(master, 1, 0, registers, 1));
  REFUSED(motorlink_st_master_get_segment(master, 1, 0));
  REFUSED(motorlink_st_master_get_profiler_info(master, 1, bytes, sizeof bytes));
  REFUSED(motorlink_st_master_raw(master, 0, MOTORLINK_ST_FRAME_CODE_SET_REG, bytes, sizeof bytes));
  REFUSED(motorlink_st_master_confirm(master));
  REFUSED(motorlink_st_master_poll(master, 0, &output));
  REFUSED(motorlink_st_master_receive(master, 0, bytes, sizeof bytes));
  REFUSED(motorlink_st_master_abandon(master));
  REFUSED(motorlink_st_master_lost(master));
  REFUSED(motorlink_st_master_reopened(master));
  REFUSED(motorlink_st_master_trust_line(master));
  REFUSED(motorlink_st_master_is_lost(master, &lost));
  groups++;
}

static void st_slave(motorlink_st_slave *slave, motorlink_error expected) {
  motorlink_bytes reply;
  uint64_t deadline;
  REFUSED(motorlink_st_slave_receive(slave, 0, 0, &reply));
  REFUSED(motorlink_st_slave_poll(slave, 0, &reply));
  REFUSED(motorlink_st_slave_deadline(slave, &deadline));
  REFUSED(motorlink_st_slave_overrun(slave, &reply));
  groups++;
}

static void rmd_host(motorlink_rmd_host *host, motorlink_error expected) {
  const motorlink_rmd_limits limits = {MOTORLINK_NO_LIMIT, 1, 1};
  const int16_t torques[4] = {0, 0, 0, 0};
  const motorlink_can_frame frame = frame_of(0x141, 8);
  motorlink_rmd_output output;
  uint64_t at;
  uint32_t motors;
  REFUSED(motorlink_rmd_host_set_times(host, 1, 1));
  REFUSED(motorlink_rmd_host_set_limits(host, 1, &limits));
  REFUSED(motorlink_rmd_host_request(host, 0, 1, motorlink_rmd_off()));
  REFUSED(motorlink_rmd_host_set_torque4(host, 0, torques, 0x0F));
  REFUSED(motorlink_rmd_host_confirm(host, 0, 1));
  REFUSED(motorlink_rmd_host_retry(host, &at));
  REFUSED(motorlink_rmd_host_poll(host, 0, &output));
  REFUSED(motorlink_rmd_host_receive(host, 0, &frame));
  REFUSED(motorlink_rmd_host_cancel(host, 0, 1));
  REFUSED(motorlink_rmd_host_trust(host, 1));
  REFUSED(motorlink_rmd_host_reopened(host, 0));
  REFUSED(motorlink_rmd_host_busy(host, &motors));
  groups++;
}

static void rmd_drive(motorlink_rmd_drive *drive, motorlink_error expected) {
  const motorlink_can_frame frame = frame_of(0x141, 8);
  motorlink_can_frame reply;
  motorlink_rmd_motion motion;
  motorlink_rmd_settings settings;
  uint64_t deadline;
  uint8_t errors;
  REFUSED(motorlink_rmd_drive_power_on(drive, 0));
  REFUSED(motorlink_rmd_drive_receive(drive, 0, &frame, &reply));
  REFUSED(motorlink_rmd_drive_poll(drive, 0));
  REFUSED(motorlink_rmd_drive_deadline(drive, &deadline));
  REFUSED(motorlink_rmd_drive_motion(drive, &motion));
  REFUSED(motorlink_rmd_drive_errors(drive, &errors));
  REFUSED(motorlink_rmd_drive_settings(drive, &settings));
  groups++;
}

static void slcan_host(motorlink_slcan_host *host, motorlink_error expected) {
  motorlink_slcan_answer answer;
  motorlink_can_frame frame;
  REFUSED(motorlink_slcan_host_receive(host, '\r', &answer, &frame));
  groups++;
}

static void slcan_device(motorlink_slcan_device *device, motorlink_error expected) {
  const motorlink_can_frame sent = frame_of(0x141, 8);
  motorlink_slcan_line line;
  motorlink_can_frame frame;
  REFUSED(motorlink_slcan_device_receive(device, '\r', &line, &frame));
  REFUSED(motorlink_slcan_device_deliver(device, 0, &sent, &line));
  groups++;
}

static void every_object(void *storage, motorlink_error expected) {
  st_master((motorlink_st_master *)storage, expected);
  st_slave((motorlink_st_slave *)storage, expected);
  rmd_host((motorlink_rmd_host *)storage, expected);
  rmd_drive((motorlink_rmd_drive *)storage, expected);
  slcan_host((motorlink_slcan_host *)storage, expected);
  slcan_device((motorlink_slcan_device *)storage, expected);
}

#endif
