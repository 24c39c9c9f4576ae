/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* The speed of an ST drive's motor 1: minimal /dev/ttyACM0 */
#include "posix.h"

#include <motorlink.h>

static void check(motorlink_error error) {
  if (error != MOTORLINK_OK) {
    fprintf(stderr, "%s\n", motorlink_error_text(error));
    exit(3);
  }
}

int main(int argc, char **argv) {
  motorlink_st_master master;
  motorlink_st_output todo;
  uint8_t bytes[256];
  int fd = open_line(argc > 1 ? argv[1] : "/dev/ttyACM0");

  check(motorlink_st_master_init(&master, sizeof master, NULL));
  check(motorlink_st_master_get_register(&master, 1, MOTORLINK_ST_REG_SPEED_MEAS));
  do {
    check(motorlink_st_master_poll(&master, now_us(), &todo));
    if (todo.kind == MOTORLINK_OUTPUT_TRANSMIT) {
      send_all(fd, todo.bytes.data, todo.bytes.size);
    } else if (todo.kind == MOTORLINK_OUTPUT_WAIT) {
      size_t size = receive_until(fd, todo.until_us, bytes, sizeof bytes);
      check(motorlink_st_master_receive(&master, now_us(), bytes, size));
    }
  } while (todo.kind != MOTORLINK_OUTPUT_DONE);
  check(todo.result);
  printf("%ld rpm\n", (long)todo.value);
  return 0;
}
