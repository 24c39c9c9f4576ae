/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * A drive on a pty whose motor never arrives: stuck_drives st|rmd [mute|twice]
 *
 * After its motor was started it does not answer (`mute`), or sends each reply twice (`twice`), but still
 * executes commands. Prints the path of the pty, and later "started" and "stopped". Ends with its stdin.
 */
#include "../../examples/posix.h"

#include "check.h"

static int running;
/* How often a reply is sent, now and after the start. */
static int replies = 1;
static int later_replies = 1;

static void answer(int fd, const uint8_t *bytes, size_t size) {
  int left;
  for (left = replies; left > 0; left--) {
    send_all(fd, bytes, size);
  }
}

static void report(int is_running) {
  if (running != is_running) {
    puts(is_running ? "started" : "stopped");
    fflush(stdout);
  }
  running = is_running;
  replies = later_replies;
}

static int32_t get_register(void *context, uint8_t motor, motorlink_st_reg reg) {
  (void)context;
  (void)motor;
  (void)reg;
  return 0;
}

static void execute(void *context, uint8_t motor, motorlink_st_command command) {
  (void)context;
  (void)motor;
  if (command == MOTORLINK_ST_COMMAND_START_MOTOR || command == MOTORLINK_ST_COMMAND_STOP_MOTOR) {
    report(command == MOTORLINK_ST_COMMAND_START_MOTOR);
  }
}

static void set_mode(void *context, const motorlink_rmd_motion *motion) {
  (void)context;
  if (running || motion->kind != MOTORLINK_RMD_MODE_OFF) {
    report(motion->kind != MOTORLINK_RMD_MODE_OFF);
  }
}

/* Without values the replies would repeat the requests, as an echo does. */
static void sense(void *context, motorlink_rmd_sense *out) {
  (void)context;
  out->temperature_celsius = 25;
}

static motorlink_st_slave slave;
static motorlink_rmd_drive drive;
static motorlink_slcan_device adapter;

static void serve_st(int fd, uint8_t byte) {
  motorlink_bytes reply;
  OK(motorlink_st_slave_receive(&slave, now_us(), byte, &reply));
  answer(fd, reply.data, reply.size);
}

static void serve_rmd(int fd, uint8_t byte) {
  motorlink_slcan_line line;
  motorlink_can_frame frame, reply;
  OK(motorlink_slcan_device_receive(&adapter, byte, &line, &frame));
  send_all(fd, line.bytes, line.size);
  if (frame.id == MOTORLINK_NO_FRAME) {
    return;
  }
  OK(motorlink_rmd_drive_receive(&drive, now_us(), &frame, &reply));
  if (reply.id != MOTORLINK_NO_FRAME) {
    OK(motorlink_slcan_device_deliver(&adapter, now_us(), &reply, &line));
    answer(fd, line.bytes, line.size);
  }
}

int main(int argc, char **argv) {
  int kept;
  int fd = serve_pty(&kept);
  int is_rmd = argc > 1 && strcmp(argv[1], "rmd") == 0;
  motorlink_st_motor_control control;
  motorlink_rmd_motor_control motor;
  motorlink_rmd_drive_config config;

  if (argc > 2 && strcmp(argv[2], "mute") == 0) {
    later_replies = 0;
  } else if (argc > 2 && strcmp(argv[2], "twice") == 0) {
    later_replies = 2;
  }
  memset(&control, 0, sizeof control);
  control.version.name = "Mute";
  control.get_register = get_register;
  control.execute = execute;
  OK(motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1, &control));
  memset(&motor, 0, sizeof motor);
  motor.set_mode = set_mode;
  motor.sense = sense;
  memset(&config, 0, sizeof config);
  config.id = 1;
  OK(motorlink_slcan_device_init(&adapter, sizeof adapter));
  OK(motorlink_rmd_drive_init(&drive, sizeof drive, &config, NULL, &motor));
  OK(motorlink_rmd_drive_power_on(&drive, now_us()));
  puts(ptsname(fd));
  fflush(stdout);

  for (;;) {
    struct pollfd ready[2];
    uint8_t bytes[256];
    ssize_t size, at;
    memset(ready, 0, sizeof ready);
    ready[0].fd = STDIN_FILENO;
    ready[0].events = POLLIN;
    ready[1].fd = fd;
    ready[1].events = POLLIN;
    CHECK(poll(ready, 2, -1) > 0);
    if (ready[0].revents != 0) {
      return 0;
    }
    size = read(fd, bytes, sizeof bytes);
    for (at = 0; at < size; at++) {
      if (is_rmd) {
        serve_rmd(fd, bytes[at]);
      } else {
        serve_st(fd, bytes[at]);
      }
    }
  }
}
