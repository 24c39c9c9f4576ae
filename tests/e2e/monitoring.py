"""A browser of `motorlink monitor`, written for the tests alone: http.client and websockets."""

import http.client
import json
import socket
import ssl
import struct
import threading
import time
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

from program import eventually
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

#: A sign of life of a page comes each 0.1 s.
ALIVE = 0.1


class Site:
    """The server that a first line of `motorlink monitor --json` describes."""

    def __init__(self, ready, context=None):
        url = urlsplit(ready["url"])
        self.scheme, self.host, self.port = url.scheme, url.hostname, url.port
        self.authority, self.context = url.netloc, context
        self.origin = f"{url.scheme}://{url.netloc}"
        self.tokens = {name: urlsplit(ready[name]).query.split("=")[1] for name in ("url", "viewer_url")}
        #: Headers of pages.
        self.operator = {"Cookie": f"motorlink-{self.port}={self.tokens['url']}"}
        self.viewer = {"Cookie": f"motorlink-{self.port}={self.tokens['viewer_url']}"}
        #: Where programs connect.
        self.path = ready["at"].removeprefix("unix:")

    def request(self, method, path, headers=(), **options):
        """(status, headers, body) of a request, with the Host of this server unless another is given."""
        kind = {"http": http.client.HTTPConnection, "https": http.client.HTTPSConnection}[self.scheme]
        secure = {"context": self.context} if self.context else {}
        connection = kind(self.host, self.port, timeout=20, **secure)
        try:
            connection.request(method, path, headers=dict(headers), **options)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def post(self, path, headers=None):
        """The status and the body of a POST of a page."""
        headers = {"Origin": self.origin, **(self.operator if headers is None else headers)}
        status, _, body = self.request("POST", path, headers)
        return status, body

    def open(self, headers=None, **options):
        """A WebSocket, as browsers open it."""
        scheme = {"http": "ws", "https": "wss"}[self.scheme]
        secure = {"ssl": self.context} if self.context else {}
        options = {"origin": self.origin, "max_size": None, "compression": None, **secure, **options}
        headers = self.operator if headers is None else headers
        return connect(f"{scheme}://{self.authority}/ws", additional_headers=headers, **options)

    @contextmanager
    def page(self, headers=None, lives=True):
        """A page that lives until it is told otherwise."""
        page = Page(self.open(headers), lives)
        try:
            yield page
        finally:
            page.leave()


class Page:
    """What the script of a page does, with its signs of life."""

    def __init__(self, opened, lives=True):
        self.socket = opened
        #: Texts and samples, in the order in which they came.
        self.heard = []
        self.news = threading.Condition()
        self.last, self.frame = 0, 0
        #: What a test changes: signs of life, and the key of hold-to-run in them.
        self.lives, self.held = lives, False
        self.has_ended = False
        #: (when it came, its number)
        self.beats = []
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.heart = threading.Thread(target=self._live, daemon=True)
        self.reader.start()
        self.welcome = self.until(kind("welcome"))
        self.heart.start()

    def _read(self):
        with suppress(ConnectionClosed, OSError, EOFError):
            for message in self.socket:
                text = json.loads(message) if isinstance(message, str) else message
                with self.news:
                    if isinstance(text, dict) and text.get("kind") == "beat":
                        self.beats.append((time.monotonic(), text["beat"]))
                        self.beat = text
                    self.heard.append(text)
                    self.news.notify_all()
        with self.news:
            self.has_ended = True
            self.news.notify_all()

    def _live(self):
        while not self.has_ended:
            if self.lives and self.beats:
                self.sign()
            time.sleep(ALIVE)

    def sign(self, **members):
        """Gives a sign of life."""
        self.frame += 1
        sign = {"beat": self.beats[-1][1], "frame": self.frame, "held": self.held, "at": time.monotonic() * 1e3}
        with suppress(ConnectionClosed, OSError):
            self.socket.send(json.dumps({**sign, **members}))

    def send(self, ask, **members):
        """Sends a request; gives its id."""
        self.last += 1
        self.socket.send(json.dumps({"id": self.last, "ask": ask, **members}))
        return self.last

    def ask(self, ask, within=15, **members):
        """The answer to a request, or its refusal."""
        sent = self.send(ask, **members)
        return self.until(lambda it: isinstance(it, dict) and it.get("id") == sent, within)

    def until(self, wanted, within=15):
        """The first message for which `wanted` is true, waited for."""
        found = []

        def look():
            found.extend(it for it in self.heard if wanted(it))
            return found or self.has_ended

        with self.news:
            ended = self.news.wait_for(look, within)
        assert found, f"{'closed' if ended else 'waited'}; heard {self.heard[-5:]}"
        return found[0]

    def alive(self):
        """Waits until the server counts it as alive, and gives it."""
        self.until(lambda it: is_kind(it, "beat") and it["at"] is not None)
        return self

    def act(self, line, motor, command, hold=False, **values):
        """The answer to a command of the protocol."""
        return self.ask("act", line=line, motor=motor, command=command, values=values, hold=hold)

    def turn(self, hold=False, node=""):
        """Turns ST motor 1 and RMD motor 2; `node` is `arm1/` in a fleet."""
        self.act_soon(f"{node}st0", 1, "SET_RAMP", hold, speed_rpm=1500, duration_ms=100)
        self.act_soon(f"{node}st0", 1, "START_MOTOR", hold)
        self.act_soon(f"{node}rmd0", 2, "set_speed", hold, speed_dps=360)

    def act_soon(self, *words, **values):
        """A command that is carried out, as soon as the motor has stopped and the line is not busy."""

        def done():
            answer = self.act(*words, **values)
            assert answer["kind"] == "answer" or answer["reason"] in ("refused", "expired", "overtaken"), answer
            return answer["kind"] == "answer"

        eventually(done, f"{words}")

    def lapsed(self, within=15):
        """Waits until the server stops the motors of the page; gives the reason."""
        return self.until(kind("lapsed"), within)["message"]

    def closed(self, within=20):
        """Waits until the server closes the connection; gives its last text that says why."""
        with self.news:
            assert self.news.wait_for(lambda: self.has_ended, within), "a closed connection"
        return next((it["message"] for it in reversed(self.heard) if is_kind(it, "closing")), None)

    def vanish(self):
        """Ends as a killed browser does: the system closes its sockets."""
        self.lives = False
        self.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        with suppress(OSError):
            self.socket.socket.shutdown(socket.SHUT_RDWR)

    def leave(self):
        self.lives = False
        with suppress(ConnectionClosed, OSError):
            self.socket.close()


def is_kind(message, name):
    return isinstance(message, dict) and message.get("kind") == name


def kind(name):
    """Whether a message is of this kind."""
    return lambda it: is_kind(it, name)


def frame(payload, opcode=1, final=True):
    """A frame of a WebSocket, from a browser."""
    size = len(payload)
    head = bytes([opcode | 0x80 * final])
    if size < 126:
        head += bytes([0x80 | size])
    elif size < 1 << 16:
        head += bytes([0x80 | 126]) + struct.pack(">H", size)
    else:
        head += bytes([0x80 | 127]) + struct.pack(">Q", size)
    return head + bytes(4) + payload


def upgraded(site, headers=None):
    """A socket behind the handshake of a WebSocket. Nothing reads from it."""
    stream = socket.create_connection((site.host, site.port), timeout=20)
    lines = [
        "GET /ws HTTP/1.1", f"Host: {site.authority}", f"Origin: {site.origin}", "Upgrade: websocket",
        "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        *(f"{name}: {value}" for name, value in (headers or site.operator).items()),
    ]
    stream.sendall("\r\n".join([*lines, "", ""]).encode())
    answer = b""
    while not answer.endswith(b"\r\n\r\n"):
        answer += stream.recv(1)
    assert b" 101 " in answer.split(b"\r\n")[0], answer
    return stream


def trusting(certificate):
    """TLS of a browser that trusts this certificate."""
    return ssl.create_default_context(cafile=str(certificate))
