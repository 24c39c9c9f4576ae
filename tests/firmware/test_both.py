"""Both UARTs at once, and how fast: figures are printed, none is judged."""

import threading
import time

from stmcp import ACK, GET_REG, TIMEOUT, frame, nack

EXCHANGES = 1000


def st_exchanges(board):
    """Reads a register again and again; checks each reply. QEMU may take more than the 25 ms of a frame
    to hand over its bytes when the machine is busy; the drive says so, and is asked again."""
    ask, reply, late = frame(GET_REG, [0x03]), frame(ACK, [1]), nack(TIMEOUT)
    left = EXCHANGES // 100
    with board.connect(board.st) as line:
        for _ in range(EXCHANGES):
            line.sendall(ask)
            while (answer := received(line, len(reply))) == late and left:
                left -= 1
                silence(line)
                line.sendall(ask)
            assert answer == reply


def silence(line):
    line.settimeout(0.1)
    try:
        while line.recv(64):
            pass
    except TimeoutError:
        line.settimeout(5)


def rmd_exchanges(board):
    """Asks motor after motor for its gains; checks each reply."""
    with board.connect(board.rmd) as line:
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


def rate(exchanges, board):
    begun = time.monotonic()
    exchanges(board)
    return EXCHANGES / (time.monotonic() - begun)


def test_bursts_on_one_uart_and_on_both(board, capsys):
    alone = [rate(st_exchanges, board), rate(rmd_exchanges, board)]
    both = {}

    def measure(exchanges):
        both[exchanges] = rate(exchanges, board)

    threads = [threading.Thread(target=measure, args=[e]) for e in (st_exchanges, rmd_exchanges)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(both) == {st_exchanges, rmd_exchanges}, "each exchange got its own reply"
    with capsys.disabled():
        print(
            f"\n{board.language}: exchanges/s alone ST {alone[0]:.0f}, RMD {alone[1]:.0f};"
            f" at once ST {both[st_exchanges]:.0f}, RMD {both[rmd_exchanges]:.0f}"
        )


def test_motors_of_both_kinds_turn_at_once(board, st, rmd, capsys):
    st("ramp", 1500, 500).ended(0)
    st("start").ended(0)
    for motor in (1, 2, 3, 4):
        rmd("-i", motor, "speed", 360).ended(0)
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        speed = st("--json", "--raw", "get", "SPEED_MEAS").ended(0).json["SPEED_MEAS"]
        if abs(speed - 1500) < 30:
            break
    assert abs(speed - 1500) < 30
    begun = time.monotonic()
    first = rmd("-i", 1, "--json", "angle").ended(0).json["angle"]
    while time.monotonic() < begun + 2:
        time.sleep(0.05)
    turned = rmd("-i", 1, "--json", "angle").ended(0).json["angle"] - first
    took = time.monotonic() - begun
    assert turned > 0
    with capsys.disabled():
        print(f"\n{board.language}: five motors turn at {turned / 360 / took:.0%} of real time")
