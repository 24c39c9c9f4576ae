/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* vectors_rmd rmd.json: each vector through the host and through the drive. */
#include "rmd_commands.h"

static motorlink_rmd_host host;
static motorlink_rmd_drive drive;

/* What the motor was told last, and what its sensors read. */
static motorlink_rmd_motion told;
static motorlink_rmd_sense sensed;

static void set_mode(void *context, const motorlink_rmd_motion *motion) {
  (void)context;
  told = *motion;
}

static void sense(void *context, motorlink_rmd_sense *out) {
  (void)context;
  *out = sensed;
}

static const motorlink_rmd_motor_control motor = {NULL, set_mode, NULL, sense, NULL};

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

/* The document names 0 and 1: the host does not send another, and the drive does not turn. */
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

static void power_on(const json_t *vector, uint8_t encoder_bits, const motorlink_rmd_settings *rom) {
  motorlink_rmd_drive_config config;
  memset(&config, 0, sizeof config);
  config.id = motor_of(vector);
  config.encoder_bits = encoder_bits;
  config.clear_reply_0x9b = data_of(vector).bytes[0] == MOTORLINK_RMD_CODE_CLEAR_ERRORS;
  OK(motorlink_rmd_drive_init(&drive, sizeof drive, &config, rom, &motor));
  OK(motorlink_rmd_drive_power_on(&drive, 0));
}

static motorlink_can_frame ask(uint32_t id, motorlink_rmd_data request) {
  motorlink_can_frame frame, reply;
  memset(&frame, 0, sizeof frame);
  frame.id = id;
  frame.size = 8;
  memcpy(frame.data, request.bytes, sizeof frame.data);
  OK(motorlink_rmd_drive_receive(&drive, 0, &frame, &reply));
  return reply;
}

/* The drive has its motor do what the request says. */
static void carried_out(const json_t *vector) {
  const json_t *f = member(vector, "fields");
  uint8_t command = command_of(vector);
  motorlink_can_frame reply;
  memset(&sensed, 0, sizeof sensed);
  power_on(vector, 18, NULL);
  reply = ask((uint32_t)strtoul(text(vector, "id"), NULL, 16), data_of(vector));
  CHECK(reply.size == 8);
  CHECK(reply.id == (uint32_t)MOTORLINK_RMD_MOTOR_BASE + motor_of(vector));
  if (unnamed_direction(f)) {
    CHECK(told.kind == MOTORLINK_RMD_MODE_OFF);
    return;
  }
  switch (command) {
    case 0:
      CHECK(told.kind == MOTORLINK_RMD_MODE_TORQUE && told.iq_16ma == number(f, "iq_1"));
      break;
    case MOTORLINK_RMD_CODE_SET_TORQUE:
      CHECK(told.kind == MOTORLINK_RMD_MODE_TORQUE && told.iq_16ma == number(f, "iq"));
      break;
    case MOTORLINK_RMD_CODE_SET_SPEED:
      CHECK(told.kind == MOTORLINK_RMD_MODE_SPEED && told.speed_centidps == number(f, "speed"));
      break;
    case MOTORLINK_RMD_CODE_SET_POSITION_LIMITED:
    case MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION_LIMITED:
      CHECK(told.max_speed_dps == number(f, "max_speed"));
      CHECK(told.kind == MOTORLINK_RMD_MODE_POSITION);
      break;
    case MOTORLINK_RMD_CODE_SET_POSITION:
    case MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION:
      CHECK(told.max_speed_dps == -1 && told.kind == MOTORLINK_RMD_MODE_POSITION);
      break;
    default:
      CHECK(told.kind == MOTORLINK_RMD_MODE_OFF);
      break;
  }
  if (told.kind == MOTORLINK_RMD_MODE_POSITION) {
    int64_t turn = INT64_C(1) << 18, angle = number(f, "angle");
    int64_t counts = (angle * turn + (angle < 0 ? -18000 : 18000)) / 36000;
    if (has(f, "direction") && number(f, "direction") != 0) {
      counts = counts == 0 ? 0 : counts - turn;
    }
    CHECK(told.target_counts == counts);
  }
}

/* A drive whose sensors and ROM have the fields gives the reply; tells whether one can. */
static int given_by_the_drive(const json_t *vector) {
  const json_t *f = member(vector, "fields");
  uint8_t command = command_of(vector), encoder_bits = 16;
  motorlink_rmd_data expected = data_of(vector), request = expected;
  motorlink_rmd_settings rom;
  motorlink_can_frame reply;
  memset(&rom, 0, sizeof rom);
  memset(&sensed, 0, sizeof sensed);
  switch (command) {
    case MOTORLINK_RMD_CODE_READ_PID:
      rom.pid = pid_of(f);
      break;
    case MOTORLINK_RMD_CODE_READ_ACCELERATION:
      rom.acceleration_dps2 = (int32_t)number(f, "acceleration");
      break;
    case MOTORLINK_RMD_CODE_READ_ENCODER:
      encoder_bits = number(f, "raw") < 1 << 14 ? 14 : 16;
      sensed.encoder_counts = number(f, "raw");
      rom.encoder_offset = (uint16_t)number(f, "offset");
      break;
    case MOTORLINK_RMD_CODE_WRITE_ZERO_ROM:
      sensed.encoder_counts = number(f, "offset");
      break;
    case MOTORLINK_RMD_CODE_READ_MULTI_TURN_ANGLE:
    case MOTORLINK_RMD_CODE_READ_SINGLE_TURN_ANGLE: {
      int64_t angle = number(f, "angle");
      encoder_bits = 18;
      if (angle > INT64_C(1) << 40 || angle < -(INT64_C(1) << 40)) {
        return 0;
      }
      /* The least counts at the angle: a count is less than a digit. */
      sensed.encoder_counts = (angle * (INT64_C(1) << 18) + (angle < 0 ? 0 : 35999)) / 36000;
      break;
    }
    case MOTORLINK_RMD_CODE_READ_STATUS:
    case MOTORLINK_RMD_CODE_CLEAR_ERRORS:
      sensed.temperature_celsius = (int8_t)number(f, "temperature");
      sensed.voltage_decivolts = (uint16_t)number(f, "voltage");
      sensed.faults = (uint8_t)number(f, "errors");
      break;
    case MOTORLINK_RMD_CODE_READ_PHASE_CURRENTS:
      sensed.phase_digits[0] = (int16_t)number(f, "phase_a");
      sensed.phase_digits[1] = (int16_t)number(f, "phase_b");
      sensed.phase_digits[2] = (int16_t)number(f, "phase_c");
      break;
    default:
      if (has(f, "iq")) {
        sensed.temperature_celsius = (int8_t)number(f, "temperature");
        sensed.iq_digits = (int16_t)number(f, "iq");
        sensed.speed_dps = (int16_t)number(f, "speed");
        sensed.encoder_counts = number(f, "encoder");
      } else if (json_object_size(f) > 0 && !is_repeated(command)) {
        return 0;
      }
      break;
  }
  power_on(vector, encoder_bits, &rom);
  if (command == MOTORLINK_RMD_CODE_CLEAR_ERRORS) {
    request.bytes[0] = command;
  }
  reply = ask((uint32_t)MOTORLINK_RMD_MOTOR_BASE + motor_of(vector), request);
  CHECK(reply.size == 8 && memcmp(reply.data, expected.bytes, 8) == 0);
  return 1;
}

int main(int argc, char **argv) {
  json_t *vectors;
  const json_t *vector;
  size_t index;
  int requests = 0, replies = 0, given = 0;

  CHECK(argc == 2);
  vectors = load(argv[1]);
  json_array_foreach(vectors, index, vector) {
    subject = text(vector, "name");
    OK(motorlink_rmd_host_init(&host, sizeof host));
    OK(motorlink_rmd_host_trust(&host, UINT32_MAX));
    if (strcmp(text(vector, "dir"), "request") == 0) {
      sent_by_the_host(vector);
      carried_out(vector);
      requests++;
    } else {
      heard_by_the_host(vector);
      given += given_by_the_drive(vector);
      replies++;
    }
  }
  CHECK(requests + replies == (int)json_array_size(vectors));
  printf("rmd: %d vectors: %d requests, %d replies, %d of them given by a drive\n",
         requests + replies, requests, replies, given);
  json_decref(vectors);
  return 0;
}
