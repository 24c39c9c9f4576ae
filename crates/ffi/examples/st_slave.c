/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * A drive with one motor on a pty: st_slave
 *
 * Prints the path that a master opens, and serves it until stdin ends. The motor is the one of fan.h.
 * Exits with 0.
 */
#include "posix.h"

#include <motorlink.h>

#include "fan.h"

static motorlink_st_slave slave;
static struct fan fan;
static motorlink_st_motor_control drive;

static void check(motorlink_error error) {
  if (error != MOTORLINK_OK) {
    fprintf(stderr, "%s\n", motorlink_error_text(error));
    exit(2);
  }
}

int main(void) {
  int kept;
  int fd = serve_pty(&kept);

  drive = fan_control(&fan);
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
