/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Commands an ST drive: st_master /dev/ttyACM0 [RPM]
 *
 * Shows what the drive is, ramps motor 1 to RPM (1000 without it) within a second, waits until it
 * turns so fast, and stops it, also after a failure. Ends with 0, with 1 where the drive refused,
 * with 3 where the line failed.
 */
#include "posix.h"

#include <motorlink.h>

enum { MOTOR = 1 };

static motorlink_st_master master;
static int started;

/* Conducts the exchange that was begun; gives what became of it. */
static motorlink_st_output exchange(int fd, motorlink_error begun) {
  motorlink_st_output output;
  if (begun != MOTORLINK_OK) {
    fprintf(stderr, "%s\n", motorlink_error_text(begun));
    exit(2);
  }
  for (;;) {
    motorlink_st_master_poll(&master, now_us(), &output);
    if (output.kind == MOTORLINK_OUTPUT_DONE) {
      return output;
    }
    if (output.kind == MOTORLINK_OUTPUT_TRANSMIT) {
      send_all(fd, output.bytes.data, output.bytes.size);
    } else {
      uint8_t bytes[256];
      size_t size = receive_until(fd, output.until_us, bytes, sizeof bytes);
      motorlink_st_master_receive(&master, now_us(), bytes, size);
    }
  }
}

/* Ends the program, and the motor before it: after a failure the line recovers for that. */
static void leave(int fd, int code) {
  if (started) {
    exchange(fd, motorlink_st_master_execute(&master, MOTOR, MOTORLINK_ST_COMMAND_STOP_MOTOR));
  }
  exit(code);
}

/* As `exchange`, for those that have to succeed. */
static motorlink_st_output done(int fd, const char *what, motorlink_error begun) {
  motorlink_st_output output = exchange(fd, begun);
  if (output.result == MOTORLINK_ERROR_REFUSED) {
    fprintf(stderr, "%s: refused with code %u\n", what, (unsigned)output.error_code);
    leave(fd, 1);
  }
  if (output.result != MOTORLINK_OK) {
    fprintf(stderr, "%s: %s\n", what, motorlink_error_text(output.result));
    leave(fd, 3);
  }
  return output;
}

static int32_t read_register(int fd, motorlink_st_reg reg) {
  return done(fd, "read", motorlink_st_master_get_register(&master, MOTOR, reg)).value;
}

int main(int argc, char **argv) {
  int32_t rpm = argc > 2 ? (int32_t)strtol(argv[2], NULL, 10) : 1000;
  int32_t speed = 0;
  uint64_t give_up;
  motorlink_st_output output;
  motorlink_st_board_info info;
  motorlink_st_master_config config = motorlink_st_master_defaults();
  motorlink_st_limits limits;
  int fd;

  if (argc < 2) {
    fprintf(stderr, "usage: %s PORT [RPM]\n", argv[0]);
    return 2;
  }
  fd = open_line(argv[1]);
  config.baud = 115200; /* as open_line sets it */
  motorlink_st_master_init(&master, sizeof master, &config);
  /* Nothing faster is sent, and no start without a ramp before it. */
  limits.speed_rpm = rpm < 0 ? -rpm : rpm;
  limits.current_s16a = MOTORLINK_NO_LIMIT;
  motorlink_st_master_set_limits(&master, &limits);

  output = done(fd, "board information", motorlink_st_master_get_board_info(&master, MOTOR));
  if (motorlink_st_decode_board_info(output.bytes.data, output.bytes.size, &info) != MOTORLINK_OK) {
    fprintf(stderr, "the board information is too short\n");
    return 3;
  }
  printf("%s %u.%u.%u\n", info.name, (unsigned)info.major, (unsigned)info.minor,
         (unsigned)info.patch);

  done(fd, "ramp", motorlink_st_master_set_ramp(&master, MOTOR, rpm, 1000));
  started = 1;
  done(fd, "start", motorlink_st_master_execute(&master, MOTOR, MOTORLINK_ST_COMMAND_START_MOTOR));
  give_up = now_us() + 20000000U;
  do {
    speed = read_register(fd, MOTORLINK_ST_REG_SPEED_MEAS);
  } while (labs((long)speed - rpm) > labs((long)rpm) / 20 && now_us() < give_up);
  printf("%ld rpm, state %ld, faults 0x%08lx\n", (long)speed,
         (long)read_register(fd, MOTORLINK_ST_REG_STATUS),
         (unsigned long)(uint32_t)read_register(fd, MOTORLINK_ST_REG_FLAGS));
  done(fd, "stop", motorlink_st_master_execute(&master, MOTOR, MOTORLINK_ST_COMMAND_STOP_MOTOR));
  started = 0;

  /* What is read-only is refused, and the line stays in step. */
  output = exchange(fd, motorlink_st_master_set_register(&master, MOTOR,
                                                         MOTORLINK_ST_REG_SPEED_MEAS, 1));
  if (output.result != MOTORLINK_ERROR_REFUSED ||
      output.error_code != MOTORLINK_ST_ERROR_CODE_SET_READ_ONLY) {
    fprintf(stderr, "the drive let a read-only register be written\n");
    return 3;
  }
  close(fd);
  return labs((long)speed - rpm) > labs((long)rpm) / 20 ? 3 : 0;
}
