/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Commands RMD motors behind an slcan adapter: rmd_host /dev/ttyACM0
 *
 * Turns motor 1 to 90 degrees, no faster than 360 degrees per second; has motors 1 to 4 hold a
 * torque current of 0 in one frame; shows that a limit holds. Switches motor 1 off, also after a
 * failure, Ctrl-C or SIGTERM. Prints nothing while the motor turns: output that is not read blocks. Ends
 * with 0, with 3 if the line failed or the motor did not acknowledge Off, and with 128 and its number
 * after a signal.
 *
 * What an earlier program asked a motor may still be answered: the first exchange with each motor
 * ends in QUARANTINED, and it is asked again when it was silent for the quarantine time.
 */
#include "posix.h"

#include <motorlink.h>

static motorlink_rmd_host host;
static motorlink_slcan_host adapter;
enum { MOTOR = 1, OFF_ATTEMPTS = 3 };

/* From before the first motion command until Off is acknowledged. */
static int turning;
/* Whether Off is being sent: the program ends behind it. */
static int leaving;

static void leave(int fd, const char *why, int code);

static void warn(void) {
  if (turning) {
    fprintf(stderr, "Off was not acknowledged: motor %d may still turn\n", MOTOR);
  }
}

static void check(int fd, motorlink_error error) {
  if (error != MOTORLINK_OK) {
    leave(fd, motorlink_error_text(error), 3);
  }
}

static void send_line(int fd, const motorlink_slcan_line *line) {
  send_all(fd, line->bytes, line->size);
}

/* Hands what the adapter says to the host, until `until_us` at the latest. */
static void hear(int fd, uint64_t until_us) {
  uint8_t bytes[256];
  size_t size = receive_until(fd, until_us, bytes, sizeof bytes);
  size_t at;
  for (at = 0; at < size; at++) {
    motorlink_slcan_answer answer;
    motorlink_can_frame frame;
    check(fd, motorlink_slcan_host_receive(&adapter, bytes[at], &answer, &frame));
    if (answer == MOTORLINK_SLCAN_ANSWER_FRAME) {
      check(fd, motorlink_rmd_host_receive(&host, now_us(), &frame));
    }
  }
}

/* Conducts exchanges until one is over; gives what became of it. */
static motorlink_rmd_output next_outcome(int fd) {
  for (;;) {
    motorlink_rmd_output output;
    motorlink_slcan_line line;
    if (caught_signal && !leaving) {
      leave(fd, "ended by a signal", 128 + caught_signal);
    }
    check(fd, motorlink_rmd_host_poll(&host, now_us(), &output));
    if (output.kind == MOTORLINK_OUTPUT_DONE) {
      return output;
    }
    if (output.kind == MOTORLINK_OUTPUT_TRANSMIT) {
      check(fd, motorlink_slcan_encode(&output.frame, &line));
      send_line(fd, &line);
    } else {
      hear(fd, output.until_us);
    }
  }
}

static motorlink_rmd_output next_done(int fd) {
  motorlink_rmd_output output = next_outcome(fd);
  check(fd, output.result);
  return output;
}

/* Waits until the exchange with the motor is over; gives its result. */
static motorlink_error result_of(int fd, uint8_t motor) {
  motorlink_rmd_output output;
  do {
    output = next_outcome(fd);
  } while (output.motor != motor);
  return output.result;
}

/*
 * Asks for Off, in place of the exchange under way, and waits for the reply. The confirmation shows that
 * the reply belongs to this Off.
 */
static void switch_off(int fd) {
  uint64_t retry_us;
  motorlink_error result;
  check(fd, motorlink_rmd_host_cancel(&host, now_us(), MOTOR));
  result = motorlink_rmd_host_request(&host, now_us(), MOTOR, motorlink_rmd_off());
  if (result == MOTORLINK_ERROR_QUARANTINED) {
    check(fd, motorlink_rmd_host_retry(&host, &retry_us));
    while (now_us() < retry_us) {
      hear(fd, retry_us);
    }
    return;
  }
  check(fd, result);
  if (result_of(fd, MOTOR) == MOTORLINK_OK) {
    check(fd, motorlink_rmd_host_confirm(&host, now_us(), MOTOR));
    turning = result_of(fd, MOTOR) != MOTORLINK_OK;
  }
}

/* Ends the program, and the motor before it. */
static void leave(int fd, const char *why, int code) {
  int attempt;
  for (attempt = 0; turning && !leaving && attempt < OFF_ATTEMPTS; attempt++) {
    leaving = 1;
    switch_off(fd);
    leaving = 0;
  }
  fprintf(stderr, "%s\n", why);
  exit(code);
}

/* Ends the program if the motor's replies so far may belong to other requests. */
static void confirm(int fd, uint8_t motor) {
  check(fd, motorlink_rmd_host_confirm(&host, now_us(), motor));
  check(fd, result_of(fd, motor));
}

/* Asks until the motor can be trusted, for 2 s at the most. */
static motorlink_rmd_data exchange(int fd, uint8_t motor, motorlink_rmd_data request) {
  uint64_t give_up = now_us() + 2000000U, retry_us;
  for (;;) {
    motorlink_error result = motorlink_rmd_host_request(&host, now_us(), motor, request);
    if (result == MOTORLINK_OK) {
      motorlink_rmd_output output = next_outcome(fd);
      if (output.result == MOTORLINK_OK) {
        return output.reply;
      }
      result = output.result;
    }
    if (result != MOTORLINK_ERROR_QUARANTINED || now_us() > give_up) {
      check(fd, result);
    }
    check(fd, motorlink_rmd_host_retry(&host, &retry_us));
    hear(fd, retry_us);
  }
}

int main(int argc, char **argv) {
  const int16_t torques[4] = {0, 0, 0, 0};
  int16_t speeds_dps[4];
  motorlink_slcan_line line;
  motorlink_rmd_status status;
  motorlink_rmd_limits limits;
  int64_t angle;
  uint64_t give_up;
  uint32_t busy;
  uint8_t motor;
  int fd, left;

  if (argc < 2) {
    fprintf(stderr, "usage: %s PORT\n", argv[0]);
    return 2;
  }
  catch_signals();
  atexit(warn);
  fd = open_line(argv[1]);
  check(fd, motorlink_slcan_host_init(&adapter, sizeof adapter));
  check(fd, motorlink_rmd_host_init(&host, sizeof host));
  /* A motor answers within some milliseconds; a computer with other work may notice it much later. */
  check(fd, motorlink_rmd_host_set_times(&host, 1000000U, 100000U));
  check(fd, motorlink_slcan_open(1000000, &line));
  send_line(fd, &line);
  hear(fd, now_us() + 100000U);

  check(fd, motorlink_rmd_decode_status(exchange(fd, 1, motorlink_rmd_read_status()), &status));
  printf("motor 1: %d degrees Celsius, %u.%u V, errors 0x%02x\n", (int)status.temperature_celsius,
         (unsigned)(status.voltage_decivolts / 10), (unsigned)(status.voltage_decivolts % 10),
         (unsigned)status.errors);

  turning = 1;
  exchange(fd, 1, motorlink_rmd_set_position_limited(9000, 360));
  confirm(fd, 1);
  give_up = now_us() + 20000000U;
  do {
    motorlink_rmd_data reply = exchange(fd, 1, motorlink_rmd_read_multi_turn_angle());
    check(fd, motorlink_rmd_decode_multi_turn_angle(reply, &angle));
  } while ((angle < 8900 || angle > 9100) && now_us() < give_up);

  for (motor = 2; motor <= 4; motor++) {
    exchange(fd, motor, motorlink_rmd_read_status());
  }
  check(fd, motorlink_rmd_host_set_torque4(&host, now_us(), torques, 0x0F));
  for (left = 4; left > 0; left--) {
    motorlink_rmd_output output = next_done(fd);
    motorlink_rmd_motion_status motion;
    check(fd, motorlink_rmd_decode_motion_status(output.reply, &motion));
    speeds_dps[output.motor - 1] = motion.speed_dps;
  }

  limits.current_16ma = 100;
  limits.speed_dps = MOTORLINK_NO_LIMIT;
  limits.angle_centidegrees = MOTORLINK_NO_LIMIT;
  check(fd, motorlink_rmd_host_set_limits(&host, 2, &limits));
  if (motorlink_rmd_host_request(&host, now_us(), 2, motorlink_rmd_set_torque(101)) !=
      MOTORLINK_ERROR_LIMIT) {
    leave(fd, "the limit did not hold", 3);
  }
  exchange(fd, 1, motorlink_rmd_off());
  confirm(fd, 1);
  turning = 0;
  for (motor = 2; motor <= 4; motor++) {
    confirm(fd, motor);
  }
  printf("motor 1: %ld hundredths of a degree\n", (long)angle);
  for (motor = 1; motor <= 4; motor++) {
    printf("motor %u: %d degrees per second\n", (unsigned)motor, (int)speeds_dps[motor - 1]);
  }
  check(fd, motorlink_rmd_host_busy(&host, &busy));
  close(fd);
  return busy == 0 && angle >= 8900 && angle <= 9100 ? 0 : 3;
}
