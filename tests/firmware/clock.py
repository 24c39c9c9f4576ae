"""The clock port of a board: who is connected to it says how the board's time passes."""

import socket
import time

TICK = 1e-4
MOST_TICKS = 255
COUNT = 0
# A machine under load may take so long for anything.
PATIENCE = 30


def connect(port):
    line = socket.create_connection(("127.0.0.1", port), PATIENCE)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line


class Clock:
    """A connection to a clock port, of which there is one at a time."""

    def __init__(self, port):
        self.line = connect(port)
        # What passed in steps of this connection.
        self.ticks = 0
        # How many bytes the board has sent, which the line's user takes off.
        self.due = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.line.close()

    def ask(self, command):
        """Sends a command; gives the answer."""
        self.line.sendall(bytes([command]))
        return self.answer()

    def answer(self):
        answer = b""
        while len(answer) < 2:
            more = self.line.recv(2 - len(answer))
            assert more, "the board hung up"
            answer += more
        self.due += answer[1]
        return answer[0]

    def delivered(self, count):
        """Waits, while the board's time stands still, until it has taken so many bytes."""
        deadline = time.monotonic() + PATIENCE
        while count > 0:
            taken = self.ask(COUNT)
            count -= taken
            if taken:
                deadline = time.monotonic() + PATIENCE
            assert time.monotonic() < deadline, "the board takes no bytes"

    def step(self, ticks):
        """Advances until then, or until bytes move; gives the ticks that passed."""
        done = self.ask(min(ticks, MOST_TICKS))
        self.ticks += done
        return done

    def advance(self, seconds):
        """Lets the board's time pass."""
        end = self.ticks + round(seconds / TICK)
        while self.ticks < end:
            self.step(end - self.ticks)
