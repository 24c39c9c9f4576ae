"""Both UARTs at once. Prints the exchange rates; no limit applies to them."""

import threading
import time

import pytest
from clock import connect
from conftest import Board
from st_wire import ACK, GET_REG, frame

EXCHANGES = 1000


def st_exchanges(board):
    """Reads a register repeatedly; checks each reply."""
    ask, reply = frame(GET_REG, [0x03]), frame(ACK, [1])
    with connect(board.st) as line:
        for _ in range(EXCHANGES):
            line.sendall(ask)
            assert received(line, len(reply)) == reply


def rmd_exchanges(board):
    """Asks motor after motor for its gains; checks each reply."""
    with connect(board.rmd) as line:
        line.sendall(b"C\rS8\rO\r")
        assert received(line, 3) == b"\r\r\r"
        for count in range(EXCHANGES):
            motor = b"1234"[count % 4 : count % 4 + 1]
            line.sendall(b"t14" + motor + b"83000000000000000\r")
            reply = b"z\rt14" + motor + b"83000646464646464\r"
            assert received(line, len(reply)) == reply


def received(line, size):
    data = b""
    while len(data) < size:
        more = line.recv(size - len(data))
        assert more, "the board hung up"
        data += more
    return data


def rates(board, *hosts):
    """Exchanges a second of each host, all of them at once."""
    rates = {}

    def measure(exchanges):
        started = time.monotonic()
        exchanges(board)
        rates[exchanges] = EXCHANGES / (time.monotonic() - started)

    threads = [threading.Thread(target=measure, args=[host]) for host in hosts]
    with board.clock() as clock:
        # After the first step the board's time advances only by steps.
        clock.step(1)
        for thread in threads:
            thread.start()
        # QEMU passes waiting bytes at each or every other step, which is fast enough for a frame.
        while any(thread.is_alive() for thread in threads):
            clock.step(1)
    assert set(rates) == set(hosts), "each exchange got its own reply"
    return [round(rates[host]) for host in hosts]


@pytest.mark.long
def test_bursts_on_one_uart_and_on_both(board, capsys):
    alone = rates(board, st_exchanges) + rates(board, rmd_exchanges)
    both = rates(board, st_exchanges, rmd_exchanges)
    with capsys.disabled():
        print(f"\n{board.language}: exchanges/s alone ST {alone[0]}, RMD {alone[1]};", end=" ")
        print(f"at once ST {both[0]}, RMD {both[1]}")


def test_motors_of_both_kinds_turn_at_once(board, st, rmd, eventually, capsys):
    def speed():
        return st("--json", "--raw", "get", "SPEED_MEAS").ended(0).values["SPEED_MEAS"]

    st("ramp", 1500, 500).ended(0)
    st("start").ended(0)
    for motor in (1, 2, 3, 4):
        rmd("-i", motor, "speed", 360).ended(0)
    eventually(lambda: abs(speed() - 1500) < 30, "1500 rpm")
    first = rmd("-i", 1, "--json", "angle").ended(0).values["multi_turn_angle"]
    started = time.monotonic()
    board.advance(2)
    took = time.monotonic() - started
    turned = rmd("-i", 1, "--json", "angle").ended(0).values["multi_turn_angle"] - first
    # Each program waits for the quarantine time, 0.1 s, before it trusts a motor.
    assert abs(turned - 360 * (2 + 0.1)) < 4
    with capsys.disabled():
        print(f"\n{board.language}: with five motors turning, time passes at {2 / took:.0%} of real time")


@pytest.mark.parametrize("language", ["rust", pytest.param("c", marks=pytest.mark.long)])
def test_a_host_can_stop_the_time_of_a_board_that_is_too_slow_for_it(language):
    # An instruction takes 1.024 us: the motors' time cannot follow the timer's.
    board = Board(language, "-icount", "shift=10,sleep=off")
    try:
        board.advance(0.1)
    finally:
        board.end()
