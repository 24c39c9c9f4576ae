/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * A drive with one motor on a pty: st_slave
 *
 * Prints the path that a master opens, and serves it until stdin ends. Its motor follows a ramp
 * exactly; a fan without a load. Ends with 0.
 */
#define _XOPEN_SOURCE 700
#include "posix.h"

#include <motorlink.h>

struct fan {
  int running;
  int32_t from_rpm, to_rpm;
  uint64_t began_us, length_us;
  int16_t speed_kp;
  motorlink_st_revup_phase revup[5];
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

static int32_t read_register(void *context, uint8_t motor, uint8_t reg) {
  const struct fan *fan = (const struct fan *)context;
  (void)motor;
  switch (reg) {
    case MOTORLINK_ST_REG_STATUS:
      return fan->running ? MOTORLINK_ST_STATUS_RUN : MOTORLINK_ST_STATUS_IDLE;
    case MOTORLINK_ST_REG_CONTROL_MODE:
      return MOTORLINK_ST_CONTROL_MODE_SPEED;
    case MOTORLINK_ST_REG_SPEED_REF:
    case MOTORLINK_ST_REG_SPEED_MEAS:
      return speed(fan);
    case MOTORLINK_ST_REG_RAMP_FINAL_SPEED:
      return fan->to_rpm;
    case MOTORLINK_ST_REG_SPEED_KP:
      return fan->speed_kp;
    case MOTORLINK_ST_REG_BUS_VOLTAGE:
      return 24;
    case MOTORLINK_ST_REG_HEATS_TEMP:
      return 25;
    default:
      return 0;
  }
}

static uint8_t write_register(void *context, uint8_t motor, uint8_t reg, int32_t value) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  if (reg != MOTORLINK_ST_REG_SPEED_KP) {
    return MOTORLINK_ST_REFUSAL_WRONG_SET;
  }
  fan->speed_kp = (int16_t)value;
  return MOTORLINK_ST_REFUSAL_NONE;
}

static void execute(void *context, uint8_t motor, uint8_t command) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  switch (command) {
    case MOTORLINK_ST_COMMAND_START_MOTOR:
      if (!fan->running) {
        fan->running = 1;
        fan->from_rpm = 0;
        fan->began_us = now_us();
      }
      break;
    case MOTORLINK_ST_COMMAND_STOP_MOTOR:
      fan->running = 0;
      break;
    default:
      break;
  }
}

static void ramp(void *context, uint8_t motor, int32_t speed_rpm, uint16_t duration_ms) {
  struct fan *fan = (struct fan *)context;
  (void)motor;
  fan->from_rpm = speed(fan);
  fan->to_rpm = speed_rpm;
  fan->length_us = (uint64_t)duration_ms * 1000U;
  fan->began_us = now_us();
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

static motorlink_st_slave slave;
static struct fan fan;
static motorlink_st_drive drive;

static void check(motorlink_error error) {
  if (error != MOTORLINK_OK) {
    fprintf(stderr, "%s\n", motorlink_error_text(error));
    exit(2);
  }
}

int main(void) {
  int fd = posix_openpt(O_RDWR | O_NOCTTY);
  int kept;
  if (fd < 0 || grantpt(fd) != 0 || unlockpt(fd) != 0) {
    fail("pty");
  }
  /* The other end stays open, so that masters may come and go. */
  kept = open_line(ptsname(fd));

  drive.context = &fan;
  drive.version.name = "Fan in C";
  drive.version.major = 1;
  drive.version.minor = 2;
  drive.read = read_register;
  drive.write = write_register;
  drive.execute = execute;
  drive.ramp = ramp;
  drive.revup = revup;
  drive.set_revup = set_revup;
  check(motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 1, &drive));
  printf("%s\n", ptsname(fd));
  fflush(stdout);

  for (;;) {
    motorlink_bytes reply;
    struct pollfd ready[2];
    uint8_t bytes[256];
    uint64_t deadline_us;
    int wait_ms = -1;
    check(motorlink_st_slave_deadline(&slave, &deadline_us));
    if (deadline_us != MOTORLINK_NEVER) {
      uint64_t now = now_us();
      wait_ms = deadline_us > now ? (int)((deadline_us - now + 999U) / 1000U) : 0;
    }
    memset(ready, 0, sizeof ready);
    ready[0].fd = STDIN_FILENO;
    ready[0].events = POLLIN;
    ready[1].fd = fd;
    ready[1].events = POLLIN;
    if (poll(ready, 2, wait_ms) < 0 && errno != EINTR) {
      fail("poll");
    }
    if (ready[0].revents != 0 && read(STDIN_FILENO, bytes, sizeof bytes) <= 0) {
      break;
    }
    if ((ready[1].revents & POLLIN) != 0) {
      ssize_t size = read(fd, bytes, sizeof bytes);
      ssize_t at;
      for (at = 0; at < size; at++) {
        check(motorlink_st_slave_receive(&slave, now_us(), bytes[at], &reply));
        send_all(fd, reply.data, reply.size);
      }
    }
    check(motorlink_st_slave_poll(&slave, now_us(), &reply));
    send_all(fd, reply.data, reply.size);
  }
  close(kept);
  close(fd);
  return 0;
}
