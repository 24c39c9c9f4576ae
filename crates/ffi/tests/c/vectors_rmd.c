/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* vectors_rmd rmd.json: each vector through the host. */
#include "rmd_commands.h"

static motorlink_rmd_host host;

static uint8_t command_of(const json_t *vector) {
  const char *command = text(vector, "command");
  return strcmp(command, "torque4") == 0 ? 0 : (uint8_t)strtoul(command, NULL, 16);
}

static uint8_t motor_of(const json_t *vector) {
  unsigned long id = strtoul(text(vector, "id"), NULL, 16);
  return id == MOTORLINK_RMD_TORQUE4_ID ? 1 : (uint8_t)(id - MOTORLINK_RMD_MOTOR_BASE);
}

static motorlink_rmd_data data_of(const json_t *vector) {
  struct bytes bytes = hex(vector, "bytes");
  motorlink_rmd_data data;
  CHECK(bytes.size == sizeof data.bytes);
  memcpy(data.bytes, bytes.data, sizeof data.bytes);
  return data;
}

static int same(motorlink_rmd_data one, motorlink_rmd_data other) {
  return memcmp(one.bytes, other.bytes, sizeof one.bytes) == 0;
}

/* The document names 0 and 1: the host does not send another. */
static int unnamed_direction(const json_t *f) {
  return has(f, "direction") && number(f, "direction") > MOTORLINK_RMD_SPIN_DIRECTION_COUNTERCLOCKWISE;
}

static motorlink_rmd_output next(uint64_t now_us, uint8_t kind) {
  motorlink_rmd_output output;
  OK(motorlink_rmd_host_poll(&host, now_us, &output));
  CHECK(output.kind == kind);
  return output;
}

/* Four torques, or a request to one motor: the frame is that of the vector. */
static void sent_by_the_host(const json_t *vector) {
  const json_t *f = member(vector, "fields");
  uint8_t command = command_of(vector);
  motorlink_rmd_output output;
  if (command == 0) {
    const int16_t torques[4] = {(int16_t)number(f, "iq_1"), (int16_t)number(f, "iq_2"),
                                (int16_t)number(f, "iq_3"), (int16_t)number(f, "iq_4")};
    OK(motorlink_rmd_host_set_torque4(&host, 0, torques, 0x0F));
  } else {
    motorlink_rmd_data request = request_of(command, f);
    motorlink_error taken = motorlink_rmd_host_request(&host, 0, motor_of(vector), request);
    CHECK(same(request, data_of(vector)));
    CHECK(taken == (unnamed_direction(f) ? MOTORLINK_ERROR_LIMIT : MOTORLINK_OK));
    if (taken != MOTORLINK_OK) {
      return;
    }
  }
  output = next(0, MOTORLINK_OUTPUT_TRANSMIT);
  CHECK(output.frame.id == strtoul(text(vector, "id"), NULL, 16) && output.frame.size == 8);
  CHECK(memcmp(output.frame.data, data_of(vector).bytes, 8) == 0);
}

/* The reply of the vector ends an exchange with its motor. */
static void heard_by_the_host(const json_t *vector) {
  uint8_t command = command_of(vector), id = motor_of(vector);
  motorlink_rmd_data reply = data_of(vector), asked = motorlink_rmd_set_torque(0);
  motorlink_can_frame frame;
  motorlink_rmd_output output;
  if (command == 0) {
    command = MOTORLINK_RMD_CODE_SET_TORQUE;
  } else if (is_repeated(command)) {
    asked = reply;
  } else {
    memset(asked.bytes, 0, sizeof asked.bytes);
    asked.bytes[0] = command;
  }
  OK(motorlink_rmd_host_request(&host, 0, id, asked));
  next(0, MOTORLINK_OUTPUT_TRANSMIT);
  memset(&frame, 0, sizeof frame);
  frame.id = (uint32_t)MOTORLINK_RMD_MOTOR_BASE + id;
  frame.size = 8;
  memcpy(frame.data, reply.bytes, sizeof frame.data);
  OK(motorlink_rmd_host_receive(&host, 800, &frame));
  output = next(800, MOTORLINK_OUTPUT_DONE);
  CHECK(output.motor == id && output.result == MOTORLINK_OK && same(output.reply, reply));
  decoded(command, output.reply, member(vector, "fields"));
}

int main(int argc, char **argv) {
  json_t *vectors;
  const json_t *vector;
  size_t index;
  int requests = 0, replies = 0;

  CHECK(argc == 2);
  vectors = load(argv[1]);
  json_array_foreach(vectors, index, vector) {
    subject = text(vector, "name");
    OK(motorlink_rmd_host_init(&host, sizeof host));
    OK(motorlink_rmd_host_trust(&host, UINT32_MAX));
    if (strcmp(text(vector, "dir"), "request") == 0) {
      sent_by_the_host(vector);
      requests++;
    } else {
      heard_by_the_host(vector);
      replies++;
    }
  }
  CHECK(requests + replies == (int)json_array_size(vectors));
  printf("rmd: %d vectors: %d requests, %d replies\n", requests + replies, requests, replies);
  json_decref(vectors);
  return 0;
}
