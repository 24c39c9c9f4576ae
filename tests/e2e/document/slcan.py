"""A Lawicel (slcan) adapter: ASCII commands on one side, CAN frames on the other.

The RMD document says nothing about it.  What it accepts:

    S0..S8 sXXXX   bit rate (channel closed)       O L   open, open listen-only
    C              close                           V v N F   versions, serial, flags
    tIIILDD..      send a standard frame           rIIIL     ... remote
    TIIIIIIIILDD.. send an extended frame          RIIIIIIIIL ... remote
    Z0 Z1          timestamps off, on              M m X W Q  taken, no effect

A command ends with \\r.  The answer is \\r, or BEL (0x07) on an error.
A sent frame is answered z\\r (standard) or Z\\r (extended), or BEL.
"""
import time

OK = b"\r"
BEL = b"\x07"
LONGEST_COMMAND = 64


class Adapter:
    """One adapter; `bus(can_id, data)` returns the reply frames."""

    def __init__(self, bus, sent_reply="z"):
        self.bus = bus
        self.sent_replies = sent_reply == "z"
        self.open()

    def open(self):
        """A new client finds the adapter as freshly plugged in."""
        self.buffer = b""
        self.channel = None         # None, "normal", "listen"
        self.timestamps = False

    close = open

    def deadline(self):
        """There are no timeouts here."""
        return None

    def expire(self, _now):
        """Never called."""
        return b""

    def receive(self, data, _now):
        """Split at \\r and answer each command in order."""
        *lines, rest = (self.buffer + data.replace(b"\n", b"")).split(b"\r")
        self.buffer = rest[-LONGEST_COMMAND:]
        return b"".join(self._answer(line.decode("latin-1")) for line in lines)

    def _answer(self, line):
        if not line:
            return OK               # hosts send bare \r to flush the line
        handler = COMMANDS.get(line[0])
        try:
            return handler(self, line) if handler else BEL
        except (ValueError, IndexError):
            return BEL

    def _set_rate(self, line):
        right = line[1:] in tuple("012345678") if line[0] == "S" else len(line) in (5, 7)
        return OK if right and self.channel is None else BEL

    def _open_channel(self, line):
        if self.channel is not None or len(line) != 1:
            return BEL
        self.channel = "listen" if line == "L" else "normal"
        return OK

    def _close_channel(self, _line):
        self.channel = None         # closing twice is no error (HOLES 47)
        return OK

    def _set_timestamps(self, line):
        if self.channel is not None or line[1:] not in ("0", "1"):
            return BEL
        self.timestamps = line[1:] == "1"
        return OK

    def _send(self, line):
        """t, T: a data frame; r, R: a remote frame, which no motor answers."""
        extended, remote = line[0] in "TR", line[0] in "rR"
        digits = 8 if extended else 3
        can_id = int(line[1:1 + digits], 16)
        length = int(line[1 + digits], 10)
        data = bytes.fromhex(line[2 + digits:])
        good = length <= 8 and len(data) == (0 if remote else length)
        good = good and can_id <= (0x1FFFFFFF if extended else 0x7FF)
        if not good or len(line) != 2 + digits + 2 * len(data) or self.channel != "normal":
            return BEL
        answer = (b"Z" if extended else b"z") if self.sent_replies else b""
        frames = [] if extended or remote else self.bus(can_id, data)
        return answer + OK + b"".join(self._received(*frame) for frame in frames)

    def _received(self, can_id, data):
        stamp = "%04X" % (int(time.monotonic() * 1000) % 60000) if self.timestamps else ""
        text = "t%03X%d%s%s\r" % (can_id, len(data), data.hex().upper(), stamp)
        return text.encode("ascii")


COMMANDS = {
    "S": Adapter._set_rate, "s": Adapter._set_rate,
    "O": Adapter._open_channel, "L": Adapter._open_channel,
    "C": Adapter._close_channel,
    "t": Adapter._send, "T": Adapter._send, "r": Adapter._send, "R": Adapter._send,
    "Z": Adapter._set_timestamps,
    "V": lambda adapter, line: b"V1013\r",
    "v": lambda adapter, line: b"v1013\r",
    "N": lambda adapter, line: b"NA123\r",
    "F": lambda adapter, line: b"F00\r" if adapter.channel else BEL,
    "M": lambda adapter, line: OK, "m": lambda adapter, line: OK,
    "X": lambda adapter, line: OK, "W": lambda adapter, line: OK,
    "Q": lambda adapter, line: OK,
}
