"""The clock port of a board: its client advances the board's time."""

import contextlib
import socket
import time

TICK = 1e-4
MOST_TICKS = 254
COUNT = 0
SYNC = 255
# Timeout on a machine under load, s.
PATIENCE = 30


def connect(port):
    line = socket.create_connection(("127.0.0.1", port), PATIENCE)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line


class Clock:
    """A connection to a clock port, of which there is one at a time."""

    def __init__(self, port):
        self.line = connect(port)
        # Ticks in steps of this connection.
        self.ticks = 0
        # Number of bytes that the board has sent and the line's user has not read.
        self.due = 0
        self.synchronise()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.line.close()

    def synchronise(self):
        """Drops pending answers to a former host; repeats the command until the board is ready."""
        deadline = time.monotonic() + PATIENCE
        self.line.settimeout(0.1)
        answer = None
        while answer != SYNC:
            assert time.monotonic() < deadline, "the board's clock port does not answer"
            self.line.sendall(bytes([SYNC]))
            with contextlib.suppress(TimeoutError):
                while (answer := self.byte()) != SYNC:
                    pass
        self.line.settimeout(PATIENCE)

    def ask(self, command):
        """Sends a command; returns the answer."""
        self.line.sendall(bytes([command]))
        return self.answer()

    def answer(self):
        while (answer := self.byte()) == SYNC:
            pass
        self.due += self.byte()
        return answer

    def byte(self):
        received = self.line.recv(1)
        assert received, "the board hung up"
        return received[0]

    def delivered(self, count):
        """Waits until the board has received this number of bytes. Its time does not advance."""
        deadline = time.monotonic() + PATIENCE
        while count > 0:
            taken = self.ask(COUNT)
            count -= taken
            if taken:
                deadline = time.monotonic() + PATIENCE
            assert time.monotonic() < deadline, "the board takes no bytes"

    def step(self, ticks):
        """Advances by at most `ticks`, or until bytes are transferred; returns the elapsed ticks."""
        done = self.ask(min(ticks, MOST_TICKS))
        self.ticks += done
        return done

    def advance(self, seconds):
        """Lets the board's time pass."""
        end = self.ticks + round(seconds / TICK)
        while self.ticks < end:
            self.step(end - self.ticks)
