"""ST MCP as bytes on the wire: what a master that shares no code with the drive sends and gets.

What a drive answers to each frame is tested in crates/proto/tests/st_exhaustive.rs and st_model.rs.
"""

import time

import pytest

from st_wire import (
    ACK,
    BAD_CRC,
    BAD_MOTOR_SELECTED,
    EXECUTE,
    GET_REG,
    GET_WRITE_ONLY,
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
FF_1Q = 0x46
ACKNOWLEDGED = frame(ACK)


@pytest.fixture
def spec(sim):
    with Line(sim(rmd=()).st) as line:
        yield line


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
