"""The board's ST drive: as bytes on the line, and as `motorlink st` drives it."""

import pytest

import test_st_bytes
from clock import MOST_TICKS
from st_wire import ACK, EXECUTE, GET_REG, TIMEOUT, Line, frame, header, nack
from test_st_bytes import (  # noqa: F401  # tests that run here with this file's fixture
    test_a_frame_in_single_bytes_is_understood,
    test_a_length_over_128_makes_the_drive_deaf_until_the_line_was_silent,
    test_a_payload_of_128_bytes_is_taken_and_one_of_128_bytes_comes_back,
    test_motors_have_registers_of_their_own_and_refuse_what_these_are_not_for,
)

SET_REVUP_DATA, START_MOTOR = 0x09, 0x01
FLAGS, STATUS, FAULT_OVER, START_UP = 0x01, 0x02, 11, 0x10


@pytest.fixture
def spec(board, on_board_time):
    with Line(board.url(board.st)) as line:
        line.eventually = on_board_time(test_st_bytes, line.port)
        yield line


def test_info_status_and_registers_are_read(st):
    info = st("--json", "info").ended(0).json
    assert info["board"] == {"name": "ST MC SDK", "version": [5, 4, 4]}
    status = st("--json", "status").ended(0).json["values"]
    assert status["BUS_VOLTAGE"] == {"value": 325, "unit": "V"}
    assert len(st("--json", "revup-data").ended(0).lines) == 5
    assert list(st("--json", "segment", "SPEED_MEAS", "I_A").ended(0).values) == ["SPEED_MEAS", "I_A"]


@pytest.mark.parametrize("motor", [1, 2])
def test_a_motor_starts_reaches_its_speed_and_stops(st, eventually, motor):
    def value(register):
        return st("-m", motor, "--json", "--raw", "get", register).ended(0).values[register]

    st("-m", motor, "ramp", 1200, 500).ended(0)
    st("-m", motor, "start").ended(0)
    eventually(lambda: abs(value("SPEED_MEAS") - 1200) <= 10, "1200 rpm")
    st("-m", motor, "ramp", 900, 100).ended(0)
    eventually(lambda: abs(value("SPEED_MEAS") - 900) <= 10, "900 rpm")
    st("-m", motor, "stop").ended(0)
    eventually(lambda: value("STATUS") == 0, "IDLE")
    assert value("FLAGS") == 0


def test_torque_turns_the_motor_with_an_encoder(st, eventually):
    def speed():
        return st("-m", 2, "--json", "--raw", "get", "SPEED_MEAS").ended(0).values["SPEED_MEAS"]

    st("-m", 2, "current-reference", 600, 0).ended(0)
    st("-m", 2, "start").ended(0)
    eventually(lambda: speed() > 200, "a motor that turns")
    st("-m", 2, "stop").ended(0)


def test_a_rotor_that_does_not_follow_is_a_fault_until_it_is_acknowledged(st, spec, eventually):
    for phase in range(5):
        # No torque, in 20 ms.
        data = [phase, *(1000).to_bytes(4, "little"), 0, 0, 20, 0]
        assert spec.ask(frame(header(SET_REVUP_DATA, 1), data)) == frame(ACK)
    assert spec.ask(frame(header(EXECUTE, 1), [START_MOTOR])) == frame(ACK)
    spec.eventually(lambda: spec.get(STATUS) == FAULT_OVER, "FAULT_OVER")
    assert spec.get(FLAGS) == START_UP
    spec.port.close()
    assert "START_UP" in st("start").ended(1).err
    st("fault-ack").ended(0)

    def status():
        return st("--json", "status").ended(0).json["values"]["STATUS"]["name"]

    eventually(lambda: status() == "IDLE", "IDLE")


@pytest.mark.parametrize("size", [1, 2, 3, 70])
def test_a_cut_off_frame_is_answered_25_ms_after_its_first_byte(spec, size):
    spec.send(frame(GET_REG, [0x03] * 80)[:size])
    spec.port.timeout = 0.0249
    assert spec.port.read(64) == b""
    spec.port.timeout = 0.0002
    assert spec.port.read(4) == nack(TIMEOUT)


def test_a_frame_of_full_length_is_in_time_however_slow_the_machine_is(spec):
    whole = frame(0x01, [0x46, *(0x01020304).to_bytes(4, "little")] + [0xEE] * 123)
    for _ in range(100):
        assert spec.ask(whole) == frame(ACK)


def test_garbage_at_full_speed_leaves_the_drive_in_order(spec):
    spec.send(bytes((index * 89 + 7) & 0xFF for index in range(20_000)))
    spec.port.timeout = 0.3
    while spec.port.read(256):
        pass
    spec.send(frame(GET_REG, [0x03]))
    assert spec.port.read(256) == frame(ACK, [1])


def test_hosts_come_and_go(board):
    for _ in range(20):
        with Line(board.url(board.st)) as line:
            assert line.get(0x03) == 1
            line.send(frame(GET_REG, [0x03])[:2])
            # The board answers this after the host has left.
            line.port.advance(0.0249)
        board.advance(0.001)


def test_a_host_that_ends_in_a_step_leaves_the_clock_in_order(board, st):
    for _ in range(10):
        with board.clock() as clock:
            clock.line.sendall(bytes([MOST_TICKS]))
        assert st("--json", "get", "STATUS").ended(0).values["STATUS"] == 0
