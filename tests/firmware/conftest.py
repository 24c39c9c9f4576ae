"""Boards in QEMU, in Rust and in C. `make firmware-test` builds them and does all of it.

MOTORLINK_FIRMWARE is the folder with the programs that firmware/build.sh makes. A test gets a board that has
just been switched on, and the program and the hosts of tests/e2e. Deadlines and motors go by the
board's time, which passes as the program and the tests say: a machine under load is slow, and the
results are the same.
"""

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

END_TO_END = Path(__file__).parents[1] / "e2e"
sys.path.insert(0, str(END_TO_END))
pytest.register_assert_rewrite("test_rmd_can", "test_st_bytes")

import serial  # noqa: E402
from clock import PATIENCE, Clock  # noqa: E402

# The scheme `board:` of pyserial's URLs.
serial.protocol_handler_packages.append("ports")

_spec = importlib.util.spec_from_file_location("end_to_end", END_TO_END / "conftest.py")
_end_to_end = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_end_to_end)
motorlink, run, start = _end_to_end.motorlink, _end_to_end.run, _end_to_end.start



def elf(program):
    path = Path(os.environ["MOTORLINK_FIRMWARE"]) / f"{program}.elf"
    assert path.exists(), f"{path} is not built: `firmware/build.sh`"
    return path


class Board:
    """A board in QEMU with its UARTs on TCP ports of this machine, which QEMU chooses. After the
    first use of the clock port its time advances only by steps."""

    def __init__(self, language, *machine, program=None):
        """`machine` are further options of QEMU; `program` one without a clock port, in real time."""
        self.language = language
        uarts = []
        for name in ("st", "rmd", "clock"):
            # Bytes go out one by one: without nodelay each waits for the last one's acknowledge.
            options = "host=127.0.0.1,port=0,server=on,wait=off,nodelay=on"
            uarts += ["-chardev", f"socket,id={name},{options}", "-serial", f"chardev:{name}"]
        self.process = subprocess.Popen(
            ["qemu-system-arm", "-M", "netduinoplus2", "-kernel", str(elf(program or f"board-{language}")), "-S"]
            + ["-display", "none", "-monitor", "none", "-qmp", "stdio", *uarts, *machine],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        try:
            self._read()
            self._do("qmp_capabilities")
            found = {device["label"]: device["filename"] for device in self._do("query-chardev")}
            self.st, self.rmd, self.clock_port = (
                int(re.search(r"127\.0\.0\.1:(\d+)", found[name])[1])
                for name in ("st", "rmd", "clock")
            )
            self._do("cont")
            if program is None:
                self.clock().close()
        except BaseException:
            self.end()
            raise

    def _read(self):
        line = self.process.stdout.readline()
        assert line, f"QEMU ended with {self.process.wait()}"
        return json.loads(line)

    def _do(self, command):
        self.process.stdin.write(json.dumps({"execute": command}) + "\n")
        self.process.stdin.flush()
        while "return" not in (answer := self._read()):
            assert "error" not in answer, answer
        return answer["return"]

    def clock(self):
        """A connection to the clock port."""
        return Clock(self.clock_port)

    def advance(self, seconds):
        """Lets the board's time pass, for tests with nothing else connected to the clock port."""
        with self.clock() as clock:
            clock.advance(seconds)

    def url(self, port):
        """What pyserial takes for a line on the board's time."""
        return f"board://127.0.0.1:{port}?clock={self.clock_port}"

    @property
    def st_port(self):
        """What -p takes for the ST drive."""
        return f"tcp:127.0.0.1:{self.st}?clock=127.0.0.1:{self.clock_port}"

    @property
    def rmd_port(self):
        """What -p takes for the RMD motors."""
        return f"slcan:tcp:127.0.0.1:{self.rmd}?clock=127.0.0.1:{self.clock_port}"

    def end(self):
        self.process.terminate()
        try:
            self.process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise


def patience(advance, pause):
    """`program.eventually` on a board's time, `pause` seconds of which pass after each try."""

    def eventually(condition, what, within=10):
        for _ in range(round(within / pause)):
            value = condition()
            if value:
                return value
            advance(pause)
        raise AssertionError(f"{what} was expected within {within} s of the board's time")

    return eventually


@pytest.fixture
def on_board_time(monkeypatch):
    """Makes the tests of a module of tests/e2e go by the time of a line that they have. Gives what waits by it."""

    def on_board_time(module, port):
        eventually = patience(port.advance, 0.005)
        for name, own in (("eventually", eventually), ("time", SimpleNamespace(monotonic=port.now))):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, own)
        return eventually

    return on_board_time


def pytest_collection_modifyitems(items):
    """Puts a run of the kit, which takes longest, before each share of the others: workers that take
    shares begin with it."""
    kits = [item for item in items if item.path.name == "test_conformance.py"]
    others = [item for item in items if item not in kits]
    share = len(others) // max(len(kits), 1) + 1
    items.clear()
    for kit in kits:
        items += [kit, *others[:share]]
        del others[:share]
    items += others


# The bare-metal example is in C, too.
@pytest.fixture(params=["rust", pytest.param("c", marks=pytest.mark.long)])
def board(request):
    """A board that has just been switched on."""
    board = Board(request.param)
    yield board
    board.end()


@pytest.fixture
def eventually(board):
    """Waits on the board's time for what the program says."""
    return patience(board.advance, 0.05)


@pytest.fixture
def st(run, board):
    """Runs `motorlink st` on the board."""
    return lambda *words, **options: run("st", "-p", board.st_port, *words, **options)


@pytest.fixture
def rmd(run, board):
    """Runs `motorlink rmd` on the board."""
    return lambda *words: run("rmd", "-p", board.rmd_port, *words)
