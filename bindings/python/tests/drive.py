"""A drive on a pty whose replies show their request, with a delay that the test chooses."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Callable
from pathlib import Path

#: Registers of 32 bits, by name and number.
REGISTERS = {"SPEED_REF": 0x04, "SPEED_MEAS": 0x1E, "RAMP_FINAL_SPEED": 0x5B}

SET_REG, GET_REG, EXECUTE, BOARD_INFO, REVUP = 0x01, 0x02, 0x03, 0x06, 0x08
START, STOP = 0x01, 0x02

#: Firmware drops a header with a greater length, and expects a header next.
MAX_LENGTH = 127
#: Sizes of the registers that a client reads first on a new line: FLAGS and STATUS.
QUESTIONS = {0x01: 4, 0x02: 1}


def value(drive: int, motor: int, register: int) -> int:
    """The value of a drive's register. No two are equal."""
    return drive << 20 | motor << 12 | register


def frame(header: int, payload: bytes) -> bytes:
    """A frame with its checksum (3)."""
    body = bytes([header, len(payload), *payload])
    total = sum(body)
    return body + bytes([(total & 0xFF) + (total >> 8) & 0xFF])


class Drive:
    """Replies on a pty at a path, to one request after the other, each after ``delay()`` s."""

    def __init__(self, path: Path, number: int, delay: Callable[[], float] = lambda: 0.0):
        self.path = path
        self.number = number
        self.delay = delay
        #: The value of every register, 16 bits, if writes are acknowledged.
        self.reads: Callable[[int], int] | None = None
        #: A register without a reply, and how often it was read.
        self.is_deaf_to: int | None = None
        self.unanswered = 0
        #: The number of replies after which it is silent.
        self.answers: int | None = None
        #: Whether it sends each reply twice, the second one after all others.
        self.twice = False
        self.heard = b""
        #: The executed commands: motor and command.
        self.executed: list[tuple[int, int]] = []
        self.plug()

    def plug(self) -> None:
        """Creates the port."""
        self._line, self._other = pty.openpty()
        tty.setraw(self._other)
        self._end, self._ended = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        self.path.symlink_to(os.ttyname(self._other))

    def unplug(self) -> None:
        """Removes the port. Pending requests get no reply."""
        self.path.unlink()
        os.close(self._ended)
        self._thread.join()
        for descriptor in (self._line, self._other, self._end):
            os.close(descriptor)

    def _ends(self, wait: float) -> bool:
        return self._end in select.select([self._end], [], [], wait)[0]

    def _serve(self) -> None:
        heard = b""
        while not self._end in select.select([self._line, self._end], [], [])[0]:
            received = os.read(self._line, 4096)
            heard += received
            self.heard += received
            while len(heard) >= 2:
                if heard[1] > MAX_LENGTH:
                    heard = heard[2:]
                    continue
                if len(heard) < heard[1] + 3:
                    break
                request, heard = heard[: heard[1] + 3], heard[heard[1] + 3 :]
                if request[0] & 0x1F == GET_REG and request[2] == self.is_deaf_to:
                    self.unanswered += 1
                    continue
                if self.answers is not None:
                    if self.answers == 0:
                        continue
                    self.answers -= 1
                reply = self._reply(request)
                if self._ends(self.delay()):
                    return
                os.write(self._line, reply * 2 if self.twice else reply)

    def _reply(self, request: bytes) -> bytes:
        motor, code, payload = request[0] >> 5, request[0] & 0x1F, request[2:-1]
        if motor == 0 and code == GET_REG and payload[0] in QUESTIONS:
            return frame(0xF0, bytes(QUESTIONS[payload[0]]))
        if self.reads is not None and code in (SET_REG, GET_REG):
            kept = self.reads(payload[0]).to_bytes(2, "little") if code == GET_REG else b""
            return frame(0xF0, kept)
        if code == GET_REG:
            told = value(self.number, motor, payload[0])
            return frame(0xF0, told.to_bytes(4, "little"))
        if code == EXECUTE:
            self.executed.append((motor, payload[0]))
            return frame(0xF0, b"")
        if code == BOARD_INFO:
            return frame(0xF0, bytes(32))
        if code == REVUP:
            return frame(0xF0, bytes(8))
        return frame(0xFF, b"\x02")
