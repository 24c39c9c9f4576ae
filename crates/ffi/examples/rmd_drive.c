/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * An RMD motor behind an slcan adapter on a pty: rmd_drive
 *
 * Prints the path that a host opens, and serves it until stdin ends. The motor has ID 1, follows
 * every command without inertia, and forgets its ROM. Ends with 0.
 */
#define _XOPEN_SOURCE 700
#include "posix.h"

#include <motorlink.h>

enum { COUNTS = 1 << 14, OWN_SPEED_DPS = 360 };

struct motor {
  motorlink_rmd_motion motion;
  uint64_t seen_us;
  /* In millionths of a count, so that slow is not still. */
  int64_t position;
  int16_t speed_dps;
};

static int64_t counts_of(int64_t dps, uint64_t us) {
  return dps * COUNTS / 360 * (int64_t)us;
}

/* Moves the motor to where it is now. */
static void turn(struct motor *motor) {
  const motorlink_rmd_motion *motion = &motor->motion;
  uint64_t now = now_us(), passed = now - motor->seen_us;
  int64_t dps = 0, target = motion->target_counts * 1000000;
  motor->seen_us = now;
  if (motion->kind == MOTORLINK_RMD_MODE_SPEED) {
    dps = motion->speed_centidps / 100;
  } else if (motion->kind == MOTORLINK_RMD_MODE_POSITION) {
    int64_t most = motion->max_speed_dps >= 0 ? motion->max_speed_dps : OWN_SPEED_DPS;
    int64_t way = target - motor->position, reach = counts_of(most, passed);
    if (way <= reach && way >= -reach) {
      motor->position = target;
    } else {
      dps = way > 0 ? most : -most;
    }
  }
  motor->position += counts_of(dps, passed);
  motor->speed_dps = (int16_t)(dps > 2000 ? 2000 : dps < -2000 ? -2000 : dps);
}

static void set_mode(void *context, const motorlink_rmd_motion *motion) {
  struct motor *motor = (struct motor *)context;
  turn(motor);
  motor->motion = *motion;
}

static void sense(void *context, motorlink_rmd_sense *out) {
  struct motor *motor = (struct motor *)context;
  turn(motor);
  out->encoder_counts = motor->position / 1000000;
  out->speed_dps = motor->speed_dps;
  out->voltage_decivolts = 240;
  out->temperature_celsius = 25;
  if (motor->motion.kind == MOTORLINK_RMD_MODE_TORQUE) {
    /* 0.016 A a digit became 33/2048 A a digit. */
    out->iq_digits = (int16_t)((int32_t)motor->motion.iq_16ma * 2048 * 16 / 33000);
  }
}

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
  int fd = posix_openpt(O_RDWR | O_NOCTTY);
  int kept;
  motorlink_rmd_drive_config config;
  if (fd < 0 || grantpt(fd) != 0 || unlockpt(fd) != 0) {
    fail("pty");
  }
  /* The other end stays open, so that hosts may come and go. */
  kept = open_line(ptsname(fd));

  callbacks.context = &motor;
  callbacks.set_mode = set_mode;
  callbacks.sense = sense;
  memset(&config, 0, sizeof config);
  config.id = 1;
  motor.seen_us = now_us();
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
    if (poll(ready, 2, -1) < 0 && errno != EINTR) {
      fail("poll");
    }
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
