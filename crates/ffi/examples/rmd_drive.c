/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * An RMD motor behind an slcan adapter on a pty: rmd_drive
 *
 * Prints the path that a host opens, and serves it until stdin ends. The motor is the one of motor.h,
 * with ID 1. Exits with 0.
 */
#include "posix.h"

#include <motorlink.h>

#include "motor.h"

static motorlink_slcan_device adapter;
static motorlink_rmd_drive drive;
static struct motor motor;
static motorlink_rmd_motor_control callbacks;

static void check(motorlink_error error) {
  if (error != MOTORLINK_OK) {
    fprintf(stderr, "%s\n", motorlink_error_text(error));
    exit(2);
  }
}

/* A byte of the host's: perhaps the end of a line, perhaps of one that has a frame. */
static void serve(int fd, uint8_t byte) {
  motorlink_slcan_line line;
  motorlink_can_frame frame, reply;
  check(motorlink_slcan_device_receive(&adapter, byte, &line, &frame));
  send_all(fd, line.bytes, line.size);
  if (frame.id == MOTORLINK_NO_FRAME) {
    return;
  }
  check(motorlink_rmd_drive_receive(&drive, now_us(), &frame, &reply));
  if (reply.id != MOTORLINK_NO_FRAME) {
    check(motorlink_slcan_device_deliver(&adapter, now_us(), &reply, &line));
    send_all(fd, line.bytes, line.size);
  }
}

int main(void) {
  int kept;
  int fd = serve_pty(&kept);
  motorlink_rmd_drive_config config;

  callbacks = motor_control(&motor);
  memset(&config, 0, sizeof config);
  config.id = 1;
  check(motorlink_slcan_device_init(&adapter, sizeof adapter));
  check(motorlink_rmd_drive_init(&drive, sizeof drive, &config, NULL, &callbacks));
  check(motorlink_rmd_drive_power_on(&drive, now_us()));
  printf("%s\n", ptsname(fd));
  fflush(stdout);

  for (;;) {
    struct pollfd ready[2];
    uint8_t bytes[256];
    memset(ready, 0, sizeof ready);
    ready[0].fd = STDIN_FILENO;
    ready[0].events = POLLIN;
    ready[1].fd = fd;
    ready[1].events = POLLIN;
    if (poll(ready, 2, 1) < 0 && errno != EINTR) {
      fail("poll");
    }
    /* Each millisecond: a fault switches the motor off also while no host sends. */
    check(motorlink_rmd_drive_poll(&drive, now_us()));
    if (ready[0].revents != 0 && read(STDIN_FILENO, bytes, sizeof bytes) <= 0) {
      break;
    }
    if ((ready[1].revents & POLLIN) != 0) {
      ssize_t size = read(fd, bytes, sizeof bytes);
      ssize_t at;
      for (at = 0; at < size; at++) {
        serve(fd, bytes[at]);
      }
    }
  }
  close(kept);
  close(fd);
  return 0;
}
