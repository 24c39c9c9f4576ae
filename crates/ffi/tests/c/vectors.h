/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Wire vectors from JSON files. Jansson, because its integers have 64 bits. */
#ifndef MOTORLINK_TEST_VECTORS_H
#define MOTORLINK_TEST_VECTORS_H

#include <jansson.h>

#include "check.h"

struct bytes {
  uint8_t data[256];
  size_t size;
};

static inline json_t *load(const char *path) {
  json_error_t error;
  json_t *vectors = json_load_file(path, 0, &error);
  subject = path;
  CHECK(json_is_array(vectors));
  return vectors;
}

static inline int has(const json_t *object, const char *key) {
  return json_object_get(object, key) != NULL;
}

static inline const json_t *member(const json_t *object, const char *key) {
  const json_t *found = json_object_get(object, key);
  if (found == NULL) {
    fprintf(stderr, "%s: no %s\n", subject, key);
    exit(1);
  }
  return found;
}

static inline int64_t number(const json_t *object, const char *key) {
  const json_t *found = member(object, key);
  CHECK(json_is_integer(found));
  return json_integer_value(found);
}

static inline double real(const json_t *object, const char *key) {
  const json_t *found = member(object, key);
  CHECK(json_is_number(found));
  return json_number_value(found);
}

static inline const char *text(const json_t *object, const char *key) {
  const json_t *found = member(object, key);
  CHECK(json_is_string(found));
  return json_string_value(found);
}

static inline struct bytes hex(const json_t *object, const char *key) {
  const char *digits = text(object, key);
  struct bytes bytes;
  memset(&bytes, 0, sizeof bytes);
  for (; digits[0] != '\0'; digits += 2) {
    char pair[3] = {digits[0], digits[1], '\0'};
    CHECK(bytes.size < sizeof bytes.data);
    bytes.data[bytes.size] = (uint8_t)strtoul(pair, NULL, 16);
    bytes.size++;
  }
  return bytes;
}

#endif
