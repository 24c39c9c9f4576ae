"""A line between programs and drives, as on a device server. Replies come late, twice or never. The
program that is connected at that time gets them."""

import heapq
import itertools
import selectors
import socket
import threading
import time
from dataclasses import dataclass


@dataclass
class Fate:
    """The faults of replies. Times in seconds."""

    late: float = 0.0
    #: Fraction of duplicate replies, and the maximum delay of the copy.
    twice: float = 0.0
    apart: float = 0.02
    #: Fraction of lost replies.
    lost: float = 0.0
    #: Whether the line echoes.
    echo: bool = False


def st_messages(pending):
    """Takes whole frames of ST's protocol off `pending`."""
    while len(pending) >= 2 and len(pending) >= pending[1] + 3:
        size = pending[1] + 3
        yield bytes(pending[:size])
        del pending[:size]


def slcan_messages(pending):
    """Takes whole lines of slcan off `pending`."""
    while (end := pending.find(b"\r") + 1) > 0:
        yield bytes(pending[:end])
        del pending[:end]


def is_reply(message):
    """Whether this is a reply of a drive, not an answer of the adapter."""
    return message[:1] in (b"t", b"\xf0", b"\xff")


class BadLine:
    """Passes bytes on between the program that has the line and the drives. `requests` and `replies` are what
    the drives were sent and said, whatever becomes of it."""

    def __init__(self, drives, messages, chance):
        self.drives = socket.create_connection(drives)
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = "tcp:127.0.0.1:%d" % self.server.getsockname()[1]
        self.messages, self.chance = messages, chance
        self.fate = Fate()
        self.requests, self.replies = [], []
        self._client, self._due, self._order = None, [], itertools.count()
        self._last = 0.0
        self._asked, self._said = bytearray(), bytearray()
        self._ended = False
        self._selector = selectors.DefaultSelector()
        for end in (self.drives, self.server):
            self._selector.register(end, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self):
        self._ended = True
        self._thread.join()
        for end in (self.drives, self.server, *filter(None, [self._client])):
            end.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _serve(self):
        while not self._ended:
            wait = self._due[0][0] - time.monotonic() if self._due else 0.05
            for key, _ in self._selector.select(min(max(wait, 0), 0.05)):
                if key.fileobj is self.server:
                    self._welcome()
                elif key.fileobj is self.drives:
                    self._hear()
                elif key.fileobj is self._client:
                    self._pass_on()
            while self._due and self._due[0][0] <= time.monotonic():
                self._tell(heapq.heappop(self._due)[2])

    def _welcome(self):
        self._leave()
        self._client, _ = self.server.accept()
        self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._selector.register(self._client, selectors.EVENT_READ)

    def _leave(self):
        if self._client is not None:
            self._selector.unregister(self._client)
            self._client.close()
        self._client = None

    def _pass_on(self):
        try:
            sent = self._client.recv(4096)
        except ConnectionError:
            sent = b""
        if not sent:
            return self._leave()
        self._asked += sent
        for message in self.messages(self._asked):
            self.requests.append(message)
            # A command of the adapter itself is not a frame.
            if self.fate.echo and message[:1] not in (b"\r", b"C", b"S", b"O"):
                self._tell(message)
            self.drives.sendall(message)

    def _hear(self):
        self._said += self.drives.recv(4096)
        for message in self.messages(self._said):
            if not is_reply(message):
                self._tell(message)
                continue
            self.replies.append(message)
            if self.chance.random() < self.fate.lost:
                continue
            # Replies keep their order; second copies do not wait for it.
            self._last = max(self._last, time.monotonic() + self.fate.late)
            self._later(self._last, message)
            if self.chance.random() < self.fate.twice:
                self._later(self._last + self.chance.uniform(0.001, self.fate.apart), message)

    def _later(self, at, message):
        heapq.heappush(self._due, (at, next(self._order), message))

    def _tell(self, message):
        if self._client is not None:
            try:
                self._client.sendall(message)
            except OSError:
                self._leave()
