"""Simulated drives, inside the process and served on ptys by the installed command."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sysconfig
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import pytest

import motorlink

REPOSITORY = Path(__file__).parents[3]

#: Timeout for a motor that is present, on a busy machine, s.
PATIENT = 2.0

# A program that a shell started in the background ignores Ctrl-C. Its child processes would too.
signal.signal(signal.SIGINT, signal.default_int_handler)
# The same holds for `nohup` and SIGHUP.
signal.signal(signal.SIGHUP, signal.SIG_DFL)

T = TypeVar("T")


def eventually(condition: Callable[[], T], what: str, within: float = 10) -> T:
    """Waits until `condition` returns a true value. Returns it."""
    deadline = time.monotonic() + within
    while True:
        value = condition()
        if value:
            return value
        assert time.monotonic() < deadline, f"{what} was expected within {within} s"
        time.sleep(0.005)


@pytest.fixture(scope="session")
def command() -> str:
    """The command `motorlink` that pip installed for this interpreter."""
    path = Path(sysconfig.get_path("scripts")) / "motorlink"
    assert os.access(path, os.X_OK), f"{path} is missing: is the package installed?"
    return str(path)


@pytest.fixture
def st_bus() -> Iterator[motorlink.st.Client]:
    """A bus with a simulated drive."""
    with motorlink.st.open("sim:") as bus:
        yield bus


@pytest.fixture
def rmd_bus() -> Iterator[motorlink.rmd.Client]:
    """A bus with four simulated motors."""
    with motorlink.rmd.open("sim:", timeout=PATIENT) as bus:
        yield bus


class Served:
    """Simulated drives on ptys, and their real state."""

    def __init__(self, command: str, folder: Path, *words: str):
        self.st, self.can = f"{folder}/st0", f"slcan:{folder}/can0"
        ports = ["--st", f"pty:{self.st}", "--rmd", f"slcan-pty:{folder}/can0"]
        self._process = subprocess.Popen(
            [command, "sim", *words, *ports],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.ports = [self._line(), self._line()]

    def _line(self) -> dict[str, Any]:
        assert self._process.stdout
        line: dict[str, Any] = json.loads(self._process.stdout.readline())
        return line

    def do(self, command: str, **fields: object) -> dict[str, Any]:
        """Executes a command of the simulator."""
        assert self._process.stdin
        self._process.stdin.write(json.dumps({"command": command, **fields}) + "\n")
        self._process.stdin.flush()
        answer = self._line()
        assert answer["ok"], answer
        return answer

    def motor(self, protocol: str, number: int) -> dict[str, object]:
        """The real state of a motor."""
        port = next(str(p["port"]) for p in self.ports if p["protocol"] == protocol)
        (bench,) = self.do("state", port=port)["state"]
        motors: list[dict[str, object]] = bench["motors"]
        return next(motor for motor in motors if motor["motor"] == number)

    def rpm(self) -> float:
        """The real speed of ST motor 1."""
        return float(str(self.motor("st", 1)["speed_rpm"]))

    @contextmanager
    def silent(self) -> Iterator[None]:
        """Drives that do not answer."""
        self._process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._process.send_signal(signal.SIGCONT)

    def end(self) -> None:
        """Ends the simulator."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.communicate(timeout=60)


@pytest.fixture
def served(command: str, tmp_path: Path) -> Iterator[Served]:
    """Drives on ptys of their own process."""
    drives = Served(command, tmp_path)
    yield drives
    drives.end()
