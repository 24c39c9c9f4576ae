"""The messages of a share, as docs/SHARE-PROTOCOL.md describes them, written for the tests alone."""

import json
import socket
import struct

TEXT, DATA = 1, 2


class Client:
    """A program at a share."""

    def __init__(self, path, name=None):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(20)
        self.socket.connect(str(path))
        self.bytes, self.last = b"", 0
        #: What came while an answer was awaited: texts, and (group, columns).
        self.others = []
        if name:
            self.ask("hello", protocol=1, name=name)

    def send(self, ask, **members):
        """Sends a request; gives its id."""
        self.last += 1
        text = json.dumps({"id": self.last, "ask": ask, **members}).encode()
        self.socket.sendall(struct.pack("<IB3x", len(text), TEXT) + text)
        return self.last

    def receive(self):
        """The next message: a text, samples as a tuple, or None at the end."""
        while True:
            if len(self.bytes) >= 8:
                size, kind = struct.unpack_from("<IB3x", self.bytes)
                if len(self.bytes) >= 8 + size:
                    payload, self.bytes = self.bytes[8 : 8 + size], self.bytes[8 + size :]
                    return json.loads(payload) if kind == TEXT else samples(payload)
            more = self.socket.recv(65536)
            if not more:
                return None
            self.bytes += more

    def ask(self, ask, **members):
        """The answer to a request, or its refusal."""
        sent = self.send(ask, **members)
        while True:
            message = self.receive()
            assert message is not None, "the share has closed the connection"
            if isinstance(message, dict) and message.get("id") == sent:
                return message
            self.others.append(message)

    def command(self, line, motor, *code, within=30):
        """The answer to a command of these bytes."""
        return self.ask("command", line=line, motor=motor, bytes=list(code), time_to_live=within)

    def read(self, line, motor, *code):
        """The bytes of a reply. A stop may replace a read, which is asked again then."""
        while True:
            answer = self.command(line, motor, *code)
            if answer.get("reason") not in ("displaced", "overtaken"):
                assert answer["kind"] == "answer", answer
                return bytes(answer["bytes"])

    def status(self, motor=1):
        """STATUS of a motor of st0."""
        return self.read("st0", motor, 2, 2)[0]

    def rpm(self, motor=1, line="st0"):
        """The speed of an ST motor, by its drive."""
        return struct.unpack("<i", self.read(line, motor, 2, 30))[0]

    def dps(self, motor, line="rmd0"):
        """The speed of an RMD motor in °/s, by itself."""
        return struct.unpack_from("<h", self.read(line, motor, 0x9C, *7 * [0]), 4)[0]

    def subscribe(self, *signals, period=0.01, queue=1000):
        """Subscribes to (line, motor, name)s."""
        signals = [{"line": line, "motor": motor, "name": name} for line, motor, name in signals]
        return self.ask("subscribe", signals=signals, period=period, queue=queue, drop="oldest")

    def until(self, wanted):
        """The next message for which `wanted` is true. Those before it are forgotten."""
        while True:
            message = self.others.pop(0) if self.others else self.receive()
            assert message is not None, "the share has closed the connection"
            if wanted(message):
                return message


def samples(payload):
    """(group, sequence, lost, t0, columns) of samples."""
    version, group, sequence, rows, columns, lost, t0 = struct.unpack_from("<6Id", payload)
    assert version == 1 and len(payload) == 32 + 8 * rows * columns
    values = struct.unpack_from(f"<{rows * columns}d", payload, 32)
    return group, sequence, lost, t0, [values[at : at + rows] for at in range(0, len(values), rows)]


def event(name, **members):
    """Whether a message is this event."""
    wanted = {"kind": "event", "event": name, **members}
    return lambda it: isinstance(it, dict) and wanted.items() <= it.items()


def speeds(client):
    """The speeds of ST motor 1 and RMD motor 2, by the drives themselves."""
    return client.rpm(), client.dps(2)


def are_still(client):
    """Whether both motors rest."""
    rpm, dps = speeds(client)
    return abs(rpm) < 30 and abs(dps) < 5
