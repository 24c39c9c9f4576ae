/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Commands RMD motors behind an slcan adapter: rmd_host /dev/ttyACM0
 *
 * Turns motor 1 to 90 degrees, no faster than 360 degrees per second; has motors 1 to 4 hold a
 * torque current of 0 in one frame; shows that a limit holds. Switches motor 1 off, also after a
 * failure. Ends with 0, with 3 where the line failed.
 *
 * What an earlier program asked a motor may still be answered: the first exchange with each motor
 * ends in QUARANTINED, and it is asked again when it was silent for the quarantine time.
 */
#include "posix.h"

#include <motorlink.h>

static motorlink_rmd_host host;
static motorlink_slcan_host adapter;
static int turning;

static void leave(int fd);

static void check(int fd, motorlink_error error) {
  if (error != MOTORLINK_OK) {
    fprintf(stderr, "%s\n", motorlink_error_text(error));
    leave(fd);
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

/* Ends the program, and the motor before it. */
static void leave(int fd) {
  if (turning) {
    turning = 0;
    if (motorlink_rmd_host_request(&host, now_us(), 1, motorlink_rmd_off()) == MOTORLINK_OK) {
      next_done(fd);
    }
  }
  exit(3);
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
    } else if (result == MOTORLINK_ERROR_QUARANTINED) {
      check(fd, motorlink_rmd_host_retry(&host, &retry_us));
      hear(fd, retry_us);
    }
    if (result != MOTORLINK_ERROR_QUARANTINED || now_us() > give_up) {
      check(fd, result);
    }
  }
}

int main(int argc, char **argv) {
  const int16_t torques[4] = {0, 0, 0, 0};
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
  fd = open_line(argv[1]);
  check(fd, motorlink_slcan_host_init(&adapter, sizeof adapter));
  check(fd, motorlink_rmd_host_init(&host, sizeof host));
  /* A motor answers within some milliseconds; a computer with other work may notice it much later. */
  check(fd, motorlink_rmd_host_set_times(&host, 1000000U, 100000U));
  check(fd, motorlink_slcan_open(1000000, &line));
  send_line(fd, &line);
  hear(fd, now_us() + 100000U);

  status = motorlink_rmd_decode_status(exchange(fd, 1, motorlink_rmd_read_status()));
  printf("motor 1: %d degrees Celsius, %u.%u V, errors 0x%02x\n", (int)status.temperature_celsius,
         (unsigned)(status.voltage_decivolts / 10), (unsigned)(status.voltage_decivolts % 10),
         (unsigned)status.errors);

  turning = 1;
  exchange(fd, 1, motorlink_rmd_set_position_limited(9000, 360));
  give_up = now_us() + 20000000U;
  do {
    motorlink_rmd_data reply = exchange(fd, 1, motorlink_rmd_read_multi_turn_angle());
    angle = motorlink_rmd_decode_multi_turn_angle(reply);
  } while ((angle < 8900 || angle > 9100) && now_us() < give_up);
  printf("motor 1: %ld hundredths of a degree\n", (long)angle);

  for (motor = 2; motor <= 4; motor++) {
    exchange(fd, motor, motorlink_rmd_read_status());
  }
  check(fd, motorlink_rmd_host_set_torque4(&host, now_us(), torques, 0x0F));
  for (left = 4; left > 0; left--) {
    motorlink_rmd_output output = next_done(fd);
    motorlink_rmd_motion_status motion = motorlink_rmd_decode_motion_status(output.reply);
    printf("motor %u: %d degrees per second\n", (unsigned)output.motor, (int)motion.speed_dps);
  }

  limits.current_16ma = 100;
  limits.speed_dps = MOTORLINK_NO_LIMIT;
  limits.angle_centidegrees = MOTORLINK_NO_LIMIT;
  check(fd, motorlink_rmd_host_set_limits(&host, 2, &limits));
  if (motorlink_rmd_host_request(&host, now_us(), 2, motorlink_rmd_set_torque(101)) !=
      MOTORLINK_ERROR_LIMIT) {
    fprintf(stderr, "the limit did not hold\n");
    leave(fd);
  }
  exchange(fd, 1, motorlink_rmd_off());
  turning = 0;
  check(fd, motorlink_rmd_host_busy(&host, &busy));
  close(fd);
  return busy == 0 && angle >= 8900 && angle <= 9100 ? 0 : 3;
}
