"""pyserial's URL `board://HOST:PORT?clock=PORT`: a line of a board whose time passes only in its reads,
its writes and `advance`. A test that has to wait for the processor does not make the board wait.
"""

import select
from urllib.parse import parse_qs, urlsplit

from serial.serialutil import PortNotOpenError, SerialBase

from clock import MOST_TICKS, TICK, Clock, connect

CHUNK = 128
ARRIVAL = 1


class Serial(SerialBase):
    """What pyserial and python-can need of a port."""

    def open(self):
        url = urlsplit(self.portstr)
        self._clock = Clock(int(parse_qs(url.query)["clock"][0]))
        self._line = connect(url.port)
        self.is_open = True

    def close(self):
        if self.is_open:
            self.is_open = False
            self._line.close()
            self._clock.close()

    def now(self):
        """The board's time since this line was opened, in seconds."""
        return self._clock.ticks * TICK

    def advance(self, seconds):
        """Lets the board's time pass."""
        self._clock.advance(seconds)

    @property
    def in_waiting(self):
        """Whether a read gives a byte at once."""
        return int(self._waits())

    def read(self, size=1):
        if not self.is_open:
            raise PortNotOpenError()
        end = None
        if self._timeout is not None:
            end = self._clock.ticks + round(self._timeout / TICK)
        received = b""
        while len(received) < size:
            if self._waits():
                more = self._line.recv(size - len(received))
                assert more, "the board hung up"
                received += more
                self._clock.due = max(0, self._clock.due - len(more))
            elif end is None:
                self._clock.step(MOST_TICKS)
            elif self._clock.ticks < end:
                self._clock.step(end - self._clock.ticks)
            else:
                break
        return received

    def write(self, data):
        if not self.is_open:
            raise PortNotOpenError()
        # A client that asks without pause sees time pass, too.
        self._clock.advance(TICK)
        for start in range(0, len(data), CHUNK):
            chunk = bytes(data[start : start + CHUNK])
            self._line.sendall(chunk)
            self._clock.delivered(len(chunk))
        return len(data)

    def flush(self):
        pass

    def reset_input_buffer(self):
        while self._waits():
            self._clock.due = max(0, self._clock.due - len(self._line.recv(4096)))

    def reset_output_buffer(self):
        pass

    def _waits(self):
        """Whether there are bytes to read. Those that the board has sent are waited for; those of its other
        line never come."""
        waits = bool(select.select([self._line], [], [], ARRIVAL if self._clock.due else 0)[0])
        if not waits:
            self._clock.due = 0
        return waits

    def _reconfigure_port(self):
        pass

    def _update_rts_state(self):
        pass

    def _update_dtr_state(self):
        pass
