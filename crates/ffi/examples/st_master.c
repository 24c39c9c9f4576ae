/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Commands an ST drive: st_master /dev/ttyACM0 [RPM]
 *
 * Shows what the drive is, ramps motor 1 to RPM (1000 without it) within a second, waits until it
 * turns so fast, and stops it, also after a failure, Ctrl-C or SIGTERM. Prints nothing while the motor
 * turns: output that is not read blocks. Ends with 0, with 1 if the drive refused or the profile may be
 * wrong, with 2 for a wrong call, with 3 if the line failed or the drive did not acknowledge the stop,
 * and with 128 and its number after a signal.
 */
#include "posix.h"

#include <motorlink.h>

enum { MOTOR = 1, STOP_ATTEMPTS = 3 };

static motorlink_st_master master;
static motorlink_st_master_config config;
/* From before START_MOTOR is sent until STOP_MOTOR is acknowledged. */
static int started;

static void warn(void) {
  if (started) {
    fprintf(stderr, "STOP_MOTOR was not acknowledged: the motor may still turn\n");
  }
}

/* Sends and receives until the exchange is over. A signal ends it before, if `may_end` is set. */
static int32_t conduct(int fd, int may_end, motorlink_st_output *output) {
  while (!may_end || !caught_signal) {
    int32_t error = motorlink_st_master_poll(&master, now_us(), output);
    if (error != MOTORLINK_OK || output->kind == MOTORLINK_OUTPUT_DONE) {
      return error;
    }
    if (output->kind == MOTORLINK_OUTPUT_TRANSMIT) {
      send_all(fd, output->bytes.data, output->bytes.size);
    } else {
      uint8_t bytes[256];
      size_t size = receive_until(fd, output->until_us, bytes, sizeof bytes);
      error = motorlink_st_master_receive(&master, now_us(), bytes, size);
      if (error != MOTORLINK_OK) {
        return error;
      }
    }
  }
  return MOTORLINK_OK;
}

static int succeeds(int fd, motorlink_error begun) {
  motorlink_st_output output;
  return begun == MOTORLINK_OK && conduct(fd, 0, &output) == MOTORLINK_OK &&
         output.result == MOTORLINK_OK;
}

/*
 * Stops the motor. If the line failed, STOP_MOTOR goes out at once and again after the recovery: the
 * drive may hear and not be heard. The confirmation shows that the acknowledge belongs to the stop.
 */
static void stop(int fd) {
  int attempt;
  for (attempt = 0; started && attempt < STOP_ATTEMPTS; attempt++) {
    motorlink_st_master_abandon(&master);
    if (succeeds(fd, motorlink_st_master_execute(&master, MOTOR,
                                                 MOTORLINK_ST_COMMAND_STOP_MOTOR)) &&
        succeeds(fd, motorlink_st_master_confirm(&master))) {
      started = 0;
    }
  }
}

static void check(int fd, const char *what, int32_t error, int code) {
  if (error != MOTORLINK_OK) {
    stop(fd);
    fprintf(stderr, "%s: %s\n", what, motorlink_error_text(error));
    exit(code);
  }
}

/* Conducts the exchange that was begun. */
static motorlink_st_output exchange(int fd, const char *what, motorlink_error begun) {
  motorlink_st_output output;
  check(fd, what, begun, 2);
  check(fd, what, conduct(fd, 1, &output), 2);
  if (caught_signal) {
    stop(fd);
    exit(128 + caught_signal);
  }
  return output;
}

/* As `exchange`, for those that have to succeed. */
static motorlink_st_output done(int fd, const char *what, motorlink_error begun) {
  motorlink_st_output output = exchange(fd, what, begun);
  if (output.result == MOTORLINK_ERROR_REFUSED) {
    unsigned code = output.error_code;
    stop(fd);
    fprintf(stderr, "%s: refused with code %u\n", what, code);
    exit(1);
  }
  check(fd, what, output.result, 3);
  return output;
}

static int32_t read_register(int fd, motorlink_st_reg reg) {
  int32_t value =
      done(fd, "read", motorlink_st_master_get_register(&master, MOTOR, reg)).value;
  check(fd, "read", motorlink_st_check_value(config.profile, reg, value), 1);
  return value;
}

int main(int argc, char **argv) {
  int32_t rpm = argc > 2 ? (int32_t)strtol(argv[2], NULL, 10) : 1000;
  int32_t speed = 0, state, faults, celsius;
  uint64_t give_up;
  motorlink_st_output output;
  motorlink_st_board_info info;
  motorlink_st_limits limits;
  int fd;

  if (argc < 2) {
    fprintf(stderr, "usage: %s PORT [RPM]\n", argv[0]);
    return 2;
  }
  catch_signals();
  atexit(warn);
  fd = open_line(argv[1]);
  config = motorlink_st_master_defaults();
  config.baud = 115200; /* as open_line sets it */
  check(fd, "master", motorlink_st_master_init(&master, sizeof master, &config), 2);
  /* Nothing faster is sent, and no start without a ramp before it. */
  limits.speed_rpm = rpm < 0 ? -rpm : rpm;
  limits.current_s16a = MOTORLINK_NO_LIMIT;
  check(fd, "limits", motorlink_st_master_set_limits(&master, &limits), 2);

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
  state = read_register(fd, MOTORLINK_ST_REG_STATUS);
  faults = read_register(fd, MOTORLINK_ST_REG_FLAGS);
  celsius = read_register(fd, MOTORLINK_ST_REG_HEATS_TEMP);
  done(fd, "stop", motorlink_st_master_execute(&master, MOTOR, MOTORLINK_ST_COMMAND_STOP_MOTOR));
  done(fd, "confirm", motorlink_st_master_confirm(&master));
  started = 0;
  printf("%ld rpm, state %ld, faults 0x%08lx, heatsink %ld degrees Celsius\n", (long)speed,
         (long)state, (unsigned long)(uint32_t)faults, (long)celsius);

  /* What is read-only is refused, and the line stays in sync. */
  output = exchange(fd, "write", motorlink_st_master_set_register(&master, MOTOR,
                                                                  MOTORLINK_ST_REG_SPEED_MEAS, 1));
  if (output.result != MOTORLINK_ERROR_REFUSED ||
      output.error_code != MOTORLINK_ST_ERROR_CODE_SET_READ_ONLY) {
    fprintf(stderr, "the drive let a read-only register be written\n");
    return 3;
  }
  close(fd);
  if (labs((long)speed - rpm) > labs((long)rpm) / 20) {
    fprintf(stderr, "the motor did not reach %ld rpm within 20 s; START_MOTOR has no effect while the motor is "
                    "stopping or in fault\n", (long)rpm);
    return 3;
  }
  return 0;
}
