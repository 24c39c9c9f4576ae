/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* vectors_st st.json: each vector through the master. */
#include "vectors.h"

static motorlink_st_master master;

static int32_t little_endian(struct bytes bytes, size_t from, size_t size) {
  uint32_t value = 0;
  size_t at;
  for (at = 0; at < size; at++) {
    value |= (uint32_t)bytes.data[from + at] << (8 * at);
  }
  if (size < 4 && (value >> (8 * size - 1)) != 0) {
    value |= 0xFFFFFFFFU << (8 * size);
  }
  return (int32_t)value;
}

static int same(motorlink_bytes sent, struct bytes expected) {
  return sent.size == expected.size && memcmp(sent.data, expected.data, sent.size) == 0;
}

static motorlink_st_revup_phase phase_of(const json_t *fields) {
  motorlink_st_revup_phase phase;
  phase.speed_rpm = (int32_t)number(fields, "speed");
  phase.torque_s16a = (int16_t)number(fields, "torque");
  phase.duration_ms = (uint16_t)number(fields, "duration");
  return phase;
}

static motorlink_st_reg register_of(const json_t *f) {
  return (motorlink_st_reg)number(f, "register");
}

/* A master reads only a segment that it configured. */
static void configure(uint8_t motor, uint8_t segment) {
  static const motorlink_st_reg registers[] = {MOTORLINK_ST_REG_STATUS};
  static const uint8_t acknowledge[] = {0xF0, 0x00, 0xF0};
  motorlink_st_output output;
  CHECK(motorlink_st_master_get_segment(&master, motor, segment) == MOTORLINK_ERROR_LIMIT);
  OK(motorlink_st_master_configure_segment(&master, motor, segment, registers, 1));
  OK(motorlink_st_master_poll(&master, 0, &output));
  OK(motorlink_st_master_poll(&master, 0, &output));
  OK(motorlink_st_master_receive(&master, 0, acknowledge, sizeof acknowledge));
  OK(motorlink_st_master_poll(&master, 0, &output));
  CHECK(output.kind == MOTORLINK_OUTPUT_DONE && output.result == MOTORLINK_OK);
}

/* Begins the exchange that a vector's fields describe. */
static void begin(const char *code, uint8_t motor, const json_t *f) {
  if (strcmp(code, "SET_REG") == 0) {
    struct bytes value = hex(f, "value");
    OK(motorlink_st_master_set_register(&master, motor, register_of(f),
                                        little_endian(value, 0, value.size)));
  } else if (strcmp(code, "GET_REG") == 0) {
    OK(motorlink_st_master_get_register(&master, motor, register_of(f)));
  } else if (strcmp(code, "EXECUTE_CMD") == 0) {
    OK(motorlink_st_master_execute(&master, motor, (motorlink_st_command)number(f, "command")));
  } else if (strcmp(code, "GET_BOARD_INFO") == 0) {
    OK(motorlink_st_master_get_board_info(&master, motor));
  } else if (strcmp(code, "SET_RAMP") == 0) {
    OK(motorlink_st_master_set_ramp(&master, motor, (int32_t)number(f, "speed"),
                                (uint16_t)number(f, "duration")));
  } else if (strcmp(code, "GET_REVUP_DATA") == 0) {
    OK(motorlink_st_master_get_revup_data(&master, motor, (uint8_t)number(f, "phase")));
  } else if (strcmp(code, "SET_REVUP_DATA") == 0) {
    motorlink_st_revup_phase phase = phase_of(f);
    OK(motorlink_st_master_set_revup_data(&master, motor, (uint8_t)number(f, "phase"), &phase));
  } else if (strcmp(code, "SET_CURRENT_REF") == 0) {
    OK(motorlink_st_master_set_current_reference(&master, motor, (int16_t)number(f, "iq"),
                                   (int16_t)number(f, "id")));
  } else if (strcmp(code, "GET_MP_INFO") == 0) {
    struct bytes steps = hex(f, "steps");
    OK(motorlink_st_master_get_profiler_info(&master, motor, steps.data, steps.size));
  } else if (strcmp(code, "GET_FW_VERSION") == 0) {
    OK(motorlink_st_master_get_firmware_version(&master, motor));
  } else if (strcmp(code, "GET_DATA_ELEMENT") == 0) {
    configure(motor, (uint8_t)number(f, "segment"));
    OK(motorlink_st_master_get_segment(&master, motor, (uint8_t)number(f, "segment")));
  } else if (strcmp(code, "CONFIG_DYN_STRUCT") == 0) {
    struct bytes registers = hex(f, "registers");
    OK(motorlink_st_master_configure_segment(&master, motor, (uint8_t)number(f, "segment"),
                                             (const motorlink_st_reg *)(const void *)registers.data,
                                             registers.size));
  } else if (strcmp(code, "SET_TORQUE_RAMP") == 0) {
    OK(motorlink_st_master_set_torque_ramp(&master, motor, (int32_t)number(f, "torque"),
                                       (uint16_t)number(f, "duration")));
  } else {
    CHECK(strcmp(code, "SET_POSITION_CMD") == 0);
    OK(motorlink_st_master_set_position(&master, motor, (float)real(f, "angle"),
                                (float)real(f, "duration")));
  }
}

/* What the master makes of the reply is what the answer says. */
static void answered(const char *code, const motorlink_st_output *done, const json_t *answer) {
  const uint8_t *payload = done->bytes.data;
  size_t size = done->bytes.size;
  if (has(answer, "error")) {
    int damage = done->error_code == MOTORLINK_ST_ERROR_CODE_BAD_CRC ||
                 done->error_code == MOTORLINK_ST_ERROR_CODE_TIMEOUT ||
                 done->error_code == MOTORLINK_ST_ERROR_CODE_OVERRUN;
    CHECK(done->error_code == (uint8_t)number(answer, "error"));
    CHECK(done->result == (damage ? MOTORLINK_ERROR_NOT_UNDERSTOOD : MOTORLINK_ERROR_REFUSED));
    CHECK(size == 0);
    return;
  }
  CHECK(done->result == MOTORLINK_OK);
  if (strcmp(code, "GET_REG") == 0) {
    CHECK(done->value == (int32_t)number(answer, "bits"));
  } else if (strcmp(code, "GET_BOARD_INFO") == 0) {
    motorlink_st_board_info info;
    const json_t *version = member(answer, "version");
    OK(motorlink_st_decode_board_info(payload, size, &info));
    CHECK(strcmp(info.name, text(answer, "name")) == 0);
    CHECK(info.major == json_integer_value(json_array_get(version, 0)));
    CHECK(info.minor == json_integer_value(json_array_get(version, 1)));
    CHECK(info.patch == json_integer_value(json_array_get(version, 2)));
  } else if (strcmp(code, "GET_FW_VERSION") == 0) {
    motorlink_st_firmware_version version;
    OK(motorlink_st_decode_firmware_version(payload, size, &version));
    CHECK(strcmp(version.name, text(answer, "name")) == 0);
    CHECK(strcmp(version.version, text(answer, "version")) == 0);
  } else if (strcmp(code, "GET_REVUP_DATA") == 0) {
    motorlink_st_revup_phase phase, expected = phase_of(answer);
    OK(motorlink_st_decode_revup_data(payload, size, &phase));
    CHECK(memcmp(&phase, &expected, sizeof phase) == 0);
  } else if (strcmp(code, "GET_DATA_ELEMENT") == 0) {
    const motorlink_st_reg chosen[3] = {MOTORLINK_ST_REG_STATUS, MOTORLINK_ST_REG_SPEED_MEAS,
                               MOTORLINK_ST_REG_I_Q};
    struct bytes values = hex(answer, "values");
    int32_t read[3];
    CHECK(same(done->bytes, values));
    OK(motorlink_st_decode_segment(payload, size, chosen, 3, read));
    CHECK(read[0] == values.data[0] && read[1] == little_endian(values, 1, 4));
    CHECK(read[2] == little_endian(values, 5, 2));
  } else {
    CHECK(size == 0);
  }
}

static motorlink_st_frame_code code_of(struct bytes frame) {
  return (motorlink_st_frame_code)(frame.data[0] & 0x1F);
}

/* Request to bytes, bytes to answer. */
static void through_the_master(const json_t *vector, motorlink_st_profile profile) {
  motorlink_st_master_config config = motorlink_st_master_defaults();
  const char *code = text(vector, "code");
  struct bytes request = hex(vector, "request");
  motorlink_st_output output;
  int raw;
  config.profile = profile;
  for (raw = 0; raw < 2; raw++) {
    OK(motorlink_st_master_init(&master, sizeof master, &config));
    OK(motorlink_st_master_trust_line(&master));
    if (raw) {
      OK(motorlink_st_master_raw(&master, request.data[0] >> 5, code_of(request), request.data + 2,
                                 request.size - 3));
    } else {
      begin(code, (uint8_t)number(vector, "motor"), member(vector, "fields"));
    }
    OK(motorlink_st_master_poll(&master, 0, &output));
    CHECK(output.kind == MOTORLINK_OUTPUT_TRANSMIT && same(output.bytes, request));
    OK(motorlink_st_master_poll(&master, 0, &output));
    CHECK(output.kind == MOTORLINK_OUTPUT_WAIT && output.until_us == config.timeout_us);
    if (has(vector, "reply")) {
      struct bytes reply = hex(vector, "reply");
      OK(motorlink_st_master_receive(&master, 1000, reply.data, reply.size));
      OK(motorlink_st_master_poll(&master, 1000, &output));
      CHECK(output.kind == MOTORLINK_OUTPUT_DONE);
      if (raw) {
        CHECK(has(member(vector, "answer"), "error") == (output.result != MOTORLINK_OK));
      } else {
        answered(code, &output, member(vector, "answer"));
      }
    }
  }
}

int main(int argc, char **argv) {
  static const motorlink_st_profile profiles[2] = {MOTORLINK_ST_PROFILE_SPEC,
                                                   MOTORLINK_ST_PROFILE_MCSDK54};
  json_t *vectors;
  const json_t *vector;
  size_t index;
  int count = 0;
  int at;

  CHECK(argc == 2);
  vectors = load(argv[1]);
  json_array_foreach(vectors, index, vector) {
    const char *spoken = text(vector, "profile");
    subject = text(vector, "name");
    for (at = 0; at < 2; at++) {
      const char *other = profiles[at] == MOTORLINK_ST_PROFILE_SPEC ? "mcsdk-5.4" : "spec";
      if (strcmp(spoken, other) != 0) {
        through_the_master(vector, profiles[at]);
        count++;
      }
    }
  }
  CHECK(count > (int)json_array_size(vectors));
  printf("st: %d times a vector\n", count);
  json_decref(vectors);
  return 0;
}
