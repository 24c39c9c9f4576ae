"""ST MCP as bytes on the wire: what a master that shares no code with the drive sends and gets."""

import json
import time
from pathlib import Path

import pytest

from program import eventually
from st_wire import (
    ACK,
    BAD_CRC,
    BAD_FRAME_ID,
    BAD_MOTOR_SELECTED,
    ERROR_CODES,
    EXECUTE,
    GET_REG,
    GET_WRITE_ONLY,
    MP_NOT_ENABLED,
    NACK,
    SET_RAMP,
    SET_READ_ONLY,
    SET_REG,
    TIMEOUT,
    WRONG_CMD,
    WRONG_SET,
    Line,
    frame,
    header,
    nack,
)

VECTORS = json.loads((Path(__file__).parents[2] / "vectors/st.json").read_text())

CONTROL_MODE, SPEED_KP, DAC_OUT2, SPEED_MEAS, I_ALPHA = 0x03, 0x05, 0x1D, 0x1E, 0x25
RAMP_FINAL_SPEED, TARGET_MOTOR, FF_1Q = 0x5B, 0x00, 0x46
START_MOTOR, STOP_MOTOR = 0x01, 0x02
ACKNOWLEDGED = frame(ACK)


@pytest.fixture
def spec(sim):
    with Line(sim(rmd=()).st) as line:
        yield line


@pytest.fixture
def mcsdk(sim):
    with Line(sim("--profile", "mcsdk-5.4", rmd=()).st) as line:
        yield line


def hexadecimal(text):
    return bytes.fromhex(text)


# The bytes of the field notes, "Checks worth having".


@pytest.mark.parametrize(
    "request_bytes, reply",
    [
        ("21 05 5b 40 06 00 00 c7", "f0 00 f0"),
        ("21 02 1d 25 65", "f0 00 f0"),
        ("0a 04 e8 03 fb ff f5", "f0 00 f0"),
        ("0b 03 00 01 02 11", "ff 01 0c 0d"),
    ],
)
def test_the_field_notes_bytes_are_answered_as_printed(mcsdk, request_bytes, reply):
    assert mcsdk.ask(hexadecimal(request_bytes)).hex(" ") == reply


def test_the_monitors_first_question_gets_the_rev_up_stage(mcsdk):
    reply = mcsdk.ask(hexadecimal("22 01 22 45"))
    assert (reply[0], reply[1]) == (ACK, 1)


def test_the_speed_reads_1998_rpm_once_the_motor_runs_that_fast(mcsdk):
    assert mcsdk.ask(frame(SET_RAMP, (1998).to_bytes(4, "little") + b"\x64\x00")) == ACKNOWLEDGED
    assert mcsdk.ask(frame(EXECUTE, [START_MOTOR])) == ACKNOWLEDGED
    asked, printed = hexadecimal("02 01 1e 21"), hexadecimal("f0 04 ce 07 00 00 ca")
    eventually(lambda: mcsdk.ask(asked) == printed, "SPEED_MEAS = 1998", within=20)


def test_shipped_firmware_keeps_speeds_in_tenths_of_a_hertz(mcsdk):
    assert mcsdk.set(RAMP_FINAL_SPEED, 1000, 4) == ACKNOWLEDGED
    assert mcsdk.get(RAMP_FINAL_SPEED) == 996
    assert mcsdk.set(RAMP_FINAL_SPEED, -605, 4) == ACKNOWLEDGED
    assert mcsdk.get(RAMP_FINAL_SPEED) == -600


def test_what_was_chosen_for_the_dac_is_read_back(mcsdk):
    assert mcsdk.set(DAC_OUT2, I_ALPHA, 1) == ACKNOWLEDGED
    assert mcsdk.get(DAC_OUT2) == I_ALPHA


def test_shipped_firmware_waits_for_ever_for_a_cut_off_frame_and_padding_frees_it(mcsdk):
    whole = frame(GET_REG, [SPEED_MEAS])
    mcsdk.send(frame(SET_REG, [0] * 100)[:50])
    mcsdk.port.timeout = 0.1
    mcsdk.send(whole)
    assert mcsdk.port.read(64) == b""

    mcsdk.send(b"\xff" * 130)
    # A refusal that comes later would be taken for an answer.
    mcsdk.port.timeout = 1
    while mcsdk.port.read(64):
        pass
    mcsdk.port.timeout = 5
    # The last byte of the padding may have been taken for a header: two tries, as in the field.
    assert ACK in (mcsdk.ask(whole)[0], mcsdk.ask(whole)[0])


def test_shipped_firmware_drops_a_length_over_127_and_takes_the_next_byte_for_a_header(mcsdk):
    mcsdk.send([GET_REG, 128])
    assert mcsdk.ask(frame(GET_REG, [SPEED_MEAS]))[0] == ACK


def test_shipped_firmware_refuses_a_short_payload_instead_of_using_old_bytes(mcsdk):
    mcsdk.ask(frame(EXECUTE, [START_MOTOR + 0x40]))
    assert mcsdk.ask(frame(EXECUTE)) == nack(WRONG_CMD)
    assert mcsdk.set(SPEED_KP, 1, 1) == nack(WRONG_SET)
    assert mcsdk.ask(frame(GET_REG)) == nack(GET_WRITE_ONLY)


# The document as written.


def test_a_whole_byte_tells_ack_from_nack_and_as_commands_they_name_motor_7(spec):
    assert spec.ask(frame(ACK)) == nack(BAD_MOTOR_SELECTED)
    assert spec.ask(frame(NACK)) == nack(BAD_MOTOR_SELECTED)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_cut_off_frame_is_answered_with_timeout_after_25_ms(spec, size):
    started = time.monotonic()
    spec.send(frame(GET_REG, [SPEED_MEAS])[:size])
    assert spec.reply() == nack(TIMEOUT)
    assert 0.024 < time.monotonic() - started < 2
    assert spec.ask(frame(GET_REG, [SPEED_MEAS]))[0] == ACK


def test_a_length_over_128_makes_the_drive_deaf_until_the_line_was_silent(spec):
    spec.send([GET_REG, 129] + [0] * 40)
    assert spec.reply() == nack(TIMEOUT)
    assert spec.ask(frame(GET_REG, [SPEED_MEAS]))[0] == ACK


def test_every_wrong_checksum_is_refused(spec):
    good = frame(GET_REG, [SPEED_MEAS])
    for wrong in set(range(256)) - {good[-1]}:
        assert spec.ask(good[:-1] + bytes([wrong])) == nack(BAD_CRC)
    assert spec.ask(good)[0] == ACK


def test_the_checksum_is_checked_before_the_motor_and_the_motor_before_the_frame_code(spec):
    unknown = 0x1F
    wrong_everything = frame(header(unknown, 5))
    assert spec.ask(wrong_everything[:-1] + b"\x00") == nack(BAD_CRC)
    assert spec.ask(wrong_everything) == nack(BAD_MOTOR_SELECTED)
    assert spec.ask(frame(header(unknown, 2))) == nack(BAD_FRAME_ID)


def test_frame_codes_that_table_1_lacks_are_refused(spec):
    known = {0x01, 0x02, 0x03, 0x06, 0x07, 0x08, 0x09, 0x0A, 0x0C, 0x0D, 0x0E}
    for code in set(range(0x20)) - known:
        assert spec.ask(frame(code)) == nack(BAD_FRAME_ID), hex(code)


def test_a_named_motor_stays_the_current_one_until_another_is_named(spec):
    assert spec.get(TARGET_MOTOR) == 0
    assert spec.get(TARGET_MOTOR, motor=2) == 1
    assert spec.get(TARGET_MOTOR) == 1
    assert spec.ask(frame(header(GET_REG, 3), [TARGET_MOTOR])) == nack(BAD_MOTOR_SELECTED)
    assert spec.get(TARGET_MOTOR) == 1
    assert spec.set(TARGET_MOTOR, 0, 1) == ACKNOWLEDGED
    assert spec.get(TARGET_MOTOR) == 0
    assert spec.set(TARGET_MOTOR, 2, 1) == nack(WRONG_SET)


def test_motors_have_registers_of_their_own(spec):
    assert spec.set(SPEED_KP, 111, 2, motor=1) == ACKNOWLEDGED
    assert spec.set(SPEED_KP, -222, 2, motor=2) == ACKNOWLEDGED
    assert (spec.get(SPEED_KP, motor=1), spec.get(SPEED_KP, motor=2)) == (111, -222)


def test_a_payload_of_128_bytes_is_taken_and_one_of_128_bytes_comes_back(spec):
    value = (0x01020304).to_bytes(4, "little")
    assert spec.ask(frame(SET_REG, [FF_1Q, *value] + [0xEE] * 123)) == ACKNOWLEDGED
    assert spec.get(FF_1Q) == 0x01020304

    assert spec.ask(frame(0x0E, [0] + [FF_1Q] * 32)) == ACKNOWLEDGED
    sampled = spec.ask(frame(0x0D, [0]))
    assert (sampled[1], sampled[2:-1]) == (128, value * 32)


def test_a_refused_segment_leaves_the_old_one(spec):
    assert spec.ask(frame(0x0E, [1, SPEED_MEAS, I_ALPHA])) == ACKNOWLEDGED
    assert spec.ask(frame(0x0E, [1, SPEED_MEAS, 0xEE])) == nack(WRONG_SET)
    assert spec.ask(frame(0x0E, [1] + [FF_1Q] * 33)) == nack(WRONG_SET)
    assert spec.ask(frame(0x0D, [1]))[1] == 4 + 2


def test_a_short_value_leaves_the_bytes_that_it_does_not_carry(spec):
    assert spec.set(SPEED_KP, 0x1234, 2) == ACKNOWLEDGED
    assert spec.ask(frame(SET_REG, [SPEED_KP, 0x78])) == ACKNOWLEDGED
    assert spec.get(SPEED_KP) == 0x1278


def test_what_a_register_is_not_for_is_refused(spec):
    assert spec.set(SPEED_MEAS, 1, 4) == nack(SET_READ_ONLY)
    assert spec.ask(frame(GET_REG, [I_ALPHA])) == nack(GET_WRITE_ONLY)
    assert spec.set(I_ALPHA, 1, 2) == nack(SET_READ_ONLY)
    assert spec.ask(frame(GET_REG, [0xEE])) == nack(GET_WRITE_ONLY)
    assert spec.ask(frame(EXECUTE, [0x0F])) == nack(WRONG_CMD)


def test_a_frame_in_single_bytes_is_understood(spec):
    for byte in frame(GET_REG, [CONTROL_MODE]):
        spec.send([byte])
    assert spec.reply() == frame(ACK, [1])


def test_noise_never_wedges_the_drive(spec):
    noise = bytes((index * 89 + 7) & 0xFF for index in range(600))
    spec.send(noise)
    # 25 ms of silence end whatever the noise began; what was answered meanwhile is dropped.
    spec.port.timeout = 0.3
    while spec.port.read(64):
        pass
    spec.port.timeout = 5
    assert spec.get(CONTROL_MODE) == 1


def test_the_drive_answers_over_tcp_as_well(sim):
    with Line(f"socket://{sim(st=('tcp',), rmd=()).st_address}") as line:
        assert line.get(CONTROL_MODE) == 1
        assert line.set(SPEED_MEAS, 1, 4) == nack(SET_READ_ONLY)


# The vectors that the Rust tests read as well.


@pytest.mark.parametrize("profile", ["spec", "mcsdk-5.4"])
def test_every_request_of_the_vectors_is_answered_in_form(sim, tmp_path, profile):
    config = tmp_path / "seven.toml"
    features = ("observer_cordic", "position_sensor", "position_control")
    everything = "".join(f"build.{feature} = true\n" for feature in features)
    config.write_text(f"[[st.motor]]\n{everything}" * 7)
    with Line(sim(config, "--profile", profile, rmd=()).st) as line:
        for vector in VECTORS:
            if vector["profile"] in (profile, "both"):
                assert_in_form(vector, line.ask(bytes.fromhex(vector["request"])))


def assert_in_form(vector, reply):
    name = vector["name"]
    if reply[0] == NACK:
        assert reply[1] == 1 and reply[2] in ERROR_CODES, name
    printed = bytes.fromhex(vector.get("reply", ""))
    if printed[:1] == bytes([ACK]):
        assert (reply[0], reply[1]) == (ACK, printed[1]), f"{name}: {reply.hex(' ')}"


def test_the_profiler_is_not_there(mcsdk):
    assert mcsdk.ask(frame(0x0B, [0])) == nack(MP_NOT_ENABLED)
    assert mcsdk.ask(frame(EXECUTE, [0x0D])) == nack(WRONG_CMD)
