"""The board's RMD motors: as frames through slcan, and as `motorlink rmd` drives them."""

import time

import pytest

import test_rmd_can
from clock import PATIENCE, connect
from test_rmd_can import (  # noqa: F401  # tests that run here with this file's fixture
    Host,
    test_a_position_command_turns_no_faster_than_it_says,
    test_a_single_turn_position_is_reached_the_way_that_is_asked,
    test_each_motor_answers_under_its_own_identifier_with_the_bytes_of_the_document,
    test_four_torques_in_one_frame_turn_four_motors_which_answer_lowest_id_first,
    test_frames_of_another_form_or_for_nobody_are_ignored,
    test_null_bytes_are_ignored_and_an_echoing_reply_echoes_them,
    test_run_resumes_what_stop_interrupted_and_nothing_after_off,
)


# The answer to the version command of the adapter.
VERSION = b"V1010\r"


@pytest.fixture
def host(board, on_board_time):
    with Host(board.url(board.rmd)) as host:
        on_board_time(test_rmd_can, host.bus.serialPortOrig)
        yield host


def test_a_scan_finds_the_motors(rmd):
    found = rmd("--json", "scan", 1, 2, 3, 4, 5).ended(0).lines
    assert [motor["motor"] for motor in found] == [1, 2, 3, 4]
    assert {motor["dialect"] for motor in found} == {"V1.62"}


def test_garbage_at_full_speed_leaves_the_drives_in_order(board, rmd):
    garbage = bytes((index * 89 + 7) & 0xFF for index in range(20_000))
    with connect(board.rmd) as line:
        line.sendall(garbage)
        line.settimeout(0.2)
        deadline = time.monotonic() + PATIENCE
        received = b""
        while not received.endswith(VERSION):
            try:
                more = line.recv(4096)
                assert more, "the board hung up"
                received += more
            except TimeoutError:
                assert time.monotonic() < deadline, "the adapter does not answer"
                # Overruns may have lost the last command.
                line.sendall(b"\rV\r")
    assert rmd("-i", 1, "--json", "status").ended(0).values["voltage"] == 24.0


def test_hosts_come_and_go(board):
    for motor in (1, 2, 3, 4) * 3:
        with Host(board.url(board.rmd)) as host:
            host.ask(motor, 0x9A)
