/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What the tests in C share: checks that end the program, and vectors from JSON. */
#ifndef MOTORLINK_TEST_CHECK_H
#define MOTORLINK_TEST_CHECK_H

#include <motorlink.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What is being tested, for messages. */
static const char *subject = "";

#define CHECK(condition)                                                              \
  do {                                                                                \
    if (!(condition)) {                                                               \
      fprintf(stderr, "%s:%d: %s: not so: %s\n", __FILE__, __LINE__, subject, #condition); \
      exit(1);                                                                        \
    }                                                                                 \
  } while (0)

#define OK(call) CHECK((call) == MOTORLINK_OK)

#endif
