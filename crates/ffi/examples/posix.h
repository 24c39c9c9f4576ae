/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What the examples need of a POSIX system: a raw serial line, a clock, waiting. Include it first. */
#ifndef MOTORLINK_EXAMPLE_POSIX_H
#define MOTORLINK_EXAMPLE_POSIX_H

#if !defined(_POSIX_C_SOURCE) && !defined(_XOPEN_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static inline void fail(const char *what) {
  fprintf(stderr, "%s: %s\n", what, strerror(errno));
  exit(3);
}

static inline uint64_t now_us(void) {
  struct timespec now;
  if (clock_gettime(CLOCK_MONOTONIC, &now) != 0) {
    fail("clock");
  }
  return (uint64_t)now.tv_sec * 1000000U + (uint64_t)now.tv_nsec / 1000U;
}

/* Every byte as it is, 8 bits, 115200 baud; reads return what there is. */
static inline void make_raw(int fd) {
  struct termios line;
  if (tcgetattr(fd, &line) != 0) {
    fail("tcgetattr");
  }
  line.c_iflag = 0;
  line.c_oflag = 0;
  line.c_lflag = 0;
  line.c_cflag = CS8 | CREAD | CLOCAL;
  line.c_cc[VMIN] = 0;
  line.c_cc[VTIME] = 0;
  if (cfsetispeed(&line, B115200) != 0 || cfsetospeed(&line, B115200) != 0 ||
      tcsetattr(fd, TCSANOW, &line) != 0) {
    fail("tcsetattr");
  }
}

static inline int open_line(const char *path) {
  int fd = open(path, O_RDWR | O_NOCTTY);
  if (fd < 0) {
    fail(path);
  }
  make_raw(fd);
  return fd;
}

static inline void send_all(int fd, const uint8_t *bytes, size_t size) {
  while (size > 0) {
    ssize_t sent = write(fd, bytes, size);
    if (sent < 0) {
      if (errno == EINTR) {
        continue;
      }
      fail("write");
    }
    bytes += (size_t)sent;
    size -= (size_t)sent;
  }
}

/* What comes until `until_us` at the latest; 0 when nothing does. */
static inline size_t receive_until(int fd, uint64_t until_us, uint8_t *bytes, size_t room) {
  uint64_t now = now_us();
  uint64_t wait_ms = until_us > now ? (until_us - now + 999U) / 1000U : 0U;
  struct pollfd ready;
  ssize_t size;
  ready.fd = fd;
  ready.events = POLLIN;
  ready.revents = 0;
  if (poll(&ready, 1, wait_ms > 3600000U ? 3600000 : (int)wait_ms) <= 0) {
    return 0;
  }
  size = read(fd, bytes, room);
  if (size < 0) {
    if (errno == EINTR || errno == EAGAIN) {
      return 0;
    }
    fail("read");
  }
  if (size == 0 && (ready.revents & POLLHUP) != 0) {
    fprintf(stderr, "the line is closed\n");
    exit(3);
  }
  return (size_t)size;
}

#endif
