"""ST MCP as bytes on the wire: what a master that shares no code with the drive sends and gets.

What a drive answers to each frame is tested in crates/proto/tests/st_exhaustive.rs and st_model.rs.
"""

import time

import pytest

from program import eventually
from st_wire import (
    ACK,
    BAD_CRC,
    BAD_MOTOR_SELECTED,
    EXECUTE,
    GET_REG,
    GET_WRITE_ONLY,
    SET_RAMP,
    SET_READ_ONLY,
    SET_REG,
    TIMEOUT,
    WRONG_CMD,
    Line,
    frame,
    header,
    nack,
)

CONTROL_MODE, SPEED_KP, SPEED_MEAS, I_ALPHA = 0x03, 0x05, 0x1E, 0x25
FF_1Q, START_MOTOR = 0x46, 0x01
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


def test_the_field_notes_bytes_are_answered_as_printed(mcsdk):
    for request, reply in (
        ("21 05 5b 40 06 00 00 c7", "f0 00 f0"),
        ("21 02 1d 25 65", "f0 00 f0"),
        ("0a 04 e8 03 fb ff f5", "f0 00 f0"),
        ("0b 03 00 01 02 11", "ff 01 0c 0d"),
    ):
        assert mcsdk.ask(hexadecimal(request)).hex(" ") == reply
    # The monitor's first question gets the stage of the rev-up.
    assert mcsdk.ask(hexadecimal("22 01 22 45"))[:2] == bytes([ACK, 1])


def test_the_speed_reads_1998_rpm_once_the_motor_runs_that_fast(mcsdk):
    assert mcsdk.ask(frame(SET_RAMP, (1998).to_bytes(4, "little") + b"\x64\x00")) == ACKNOWLEDGED
    assert mcsdk.ask(frame(EXECUTE, [START_MOTOR])) == ACKNOWLEDGED
    asked, printed = hexadecimal("02 01 1e 21"), hexadecimal("f0 04 ce 07 00 00 ca")
    eventually(lambda: mcsdk.ask(asked) == printed, "SPEED_MEAS = 1998", within=20)


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


# The document as written.


def test_a_cut_off_frame_is_answered_with_timeout_after_25_ms(spec):
    started = time.monotonic()
    spec.send(frame(GET_REG, [SPEED_MEAS])[:3])
    assert spec.reply() == nack(TIMEOUT)
    assert 0.024 < time.monotonic() - started < 2
    assert spec.ask(frame(GET_REG, [SPEED_MEAS]))[0] == ACK


def test_a_length_over_128_makes_the_drive_deaf_until_the_line_was_silent(spec):
    spec.send([GET_REG, 129] + [0] * 40)
    assert spec.reply() == nack(TIMEOUT)
    assert spec.ask(frame(GET_REG, [SPEED_MEAS]))[0] == ACK


def test_a_payload_of_128_bytes_is_taken_and_one_of_128_bytes_comes_back(spec):
    value = (0x01020304).to_bytes(4, "little")
    assert spec.ask(frame(SET_REG, [FF_1Q, *value] + [0xEE] * 123)) == ACKNOWLEDGED
    assert spec.get(FF_1Q) == 0x01020304

    assert spec.ask(frame(0x0E, [0] + [FF_1Q] * 32)) == ACKNOWLEDGED
    sampled = spec.ask(frame(0x0D, [0]))
    assert (sampled[1], sampled[2:-1]) == (128, value * 32)


def test_motors_have_registers_of_their_own_and_refuse_what_these_are_not_for(spec):
    assert spec.set(SPEED_KP, 111, 2, motor=1) == ACKNOWLEDGED
    assert spec.set(SPEED_KP, -222, 2, motor=2) == ACKNOWLEDGED
    assert (spec.get(SPEED_KP, motor=1), spec.get(SPEED_KP, motor=2)) == (111, -222)
    assert spec.set(SPEED_MEAS, 1, 4) == nack(SET_READ_ONLY)
    assert spec.ask(frame(GET_REG, [I_ALPHA])) == nack(GET_WRITE_ONLY)
    assert spec.ask(frame(EXECUTE, [0x0F])) == nack(WRONG_CMD)
    assert spec.ask(frame(header(GET_REG, 3), [SPEED_KP])) == nack(BAD_MOTOR_SELECTED)
    good = frame(GET_REG, [SPEED_KP])
    assert spec.ask(good[:-1] + bytes([good[-1] ^ 1])) == nack(BAD_CRC)


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
