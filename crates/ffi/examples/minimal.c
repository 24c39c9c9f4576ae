/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* The speed of an ST drive's motor 1: minimal /dev/ttyACM0 */
#define _POSIX_C_SOURCE 200809L
#include "posix.h"

#include <motorlink.h>

int main(int argc, char **argv) {
  int fd = argc == 2 ? open_line(argv[1]) : (fprintf(stderr, "usage: %s PORT\n", argv[0]), exit(2), -1);
  motorlink_st_master master;
  motorlink_st_action todo;
  uint8_t bytes[256];
  motorlink_st_master_init(&master, sizeof master, NULL);
  motorlink_st_master_get_register(&master, 1, MOTORLINK_ST_REG_SPEED_MEAS);
  for (;;) {
    motorlink_st_master_poll(&master, now_us(), &todo);
    if (todo.kind == MOTORLINK_ACTION_DONE) break;
    if (todo.kind == MOTORLINK_ACTION_TRANSMIT) send_all(fd, todo.bytes.data, todo.bytes.size);
    else motorlink_st_master_receive(&master, now_us(), bytes,
                                     receive_until(fd, todo.until_us, bytes, sizeof bytes));
  }
  if (todo.result == MOTORLINK_OK) printf("%d rpm\n", (int)todo.value);
  else fprintf(stderr, "%s\n", motorlink_error_text(todo.result));
  return todo.result == MOTORLINK_OK ? 0 : 3;
}
