/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * What the examples need of a POSIX system: a raw serial line, a clock, waiting, signals. Include it
 * first.
 */
#ifndef MOTORLINK_EXAMPLE_POSIX_H
#define MOTORLINK_EXAMPLE_POSIX_H

#ifndef _XOPEN_SOURCE
#define _XOPEN_SOURCE 700
#endif

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
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

/* Locks the line, so that no second program sends on it. */
static inline void lock_line(int fd, const char *path) {
  const char *device = ttyname(fd);
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) {
      fprintf(stderr, "%s: in use by another program\n", path);
      exit(3);
    }
    fail(path);
  }
  /* Also excludes programs that do not lock. A pty would keep this mode after the program. */
  if (device != NULL && strncmp(device, "/dev/pts/", 9) != 0 && ioctl(fd, TIOCEXCL) != 0) {
    fail(path);
  }
}

static inline int open_device(const char *path) {
  int fd = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) {
    fail(path);
  }
  return fd;
}

/* Opens a serial line and locks it. */
static inline int open_line(const char *path) {
  int fd = open_device(path);
  lock_line(fd, path);
  make_raw(fd);
  return fd;
}

/* Opens a pty for a simulated drive. Its other end stays open, so that programs may come and go. */
static inline int serve_pty(int *kept) {
  int fd = posix_openpt(O_RDWR | O_NOCTTY);
  if (fd < 0 || grantpt(fd) != 0 || unlockpt(fd) != 0) {
    fail("pty");
  }
  *kept = open_device(ptsname(fd));
  make_raw(*kept);
  return fd;
}

/* The signal that asks the program to end; 0: none. */
static volatile sig_atomic_t caught_signal;

static inline void note_signal(int number) {
  caught_signal = number;
}

/*
 * From now on these signals do not end the program: it has to stop its motor first. A signal ends
 * the wait in `receive_until`. What is ignored stays ignored.
 */
static inline void catch_signals(void) {
  static const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE};
  size_t i;
  for (i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
    struct sigaction action;
    if (sigaction(numbers[i], NULL, &action) != 0) {
      fail("sigaction");
    }
    if (action.sa_handler == SIG_IGN) {
      continue;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = note_signal;
    if (sigaction(numbers[i], &action, NULL) != 0) {
      fail("sigaction");
    }
  }
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
