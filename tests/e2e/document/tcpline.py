"""A serial line served over TCP: one client at a time, and a steady clock.

Both programs use this loop.  A *session* is the thing at the end of the line:

    session.open()                   a client has come
    session.close()                  the client has left
    session.receive(data, now)       bytes came in; returns the bytes to send
    session.deadline()               a moment at which to call expire(), or None
    session.expire(now)              that moment is past; returns bytes to send

`tick(now)` is called at least every TICK seconds, client or no client, so the
model behind the line lives in real time.  The optional *control* port takes
text lines (one command a line) and is a back door for test benches: faults,
power, temperatures.  It is no part of the protocols.
"""
import select
import socket
import time

TICK = 0.01
CHUNK = 4096


def parse_address(text):
    """'127.0.0.1:4000' -> ('127.0.0.1', 4000)."""
    host, _, port = text.rpartition(":")
    return host or "127.0.0.1", int(port)


def open_listener(address):
    """A listening TCP socket on (host, port); port 0 = any."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(address)
    listener.listen(8)
    return listener


class LineServer:
    """The loop: one line client, any number of control clients, one clock."""

    def __init__(self, session, tick, listen, control=None, run_command=None):
        self.session = session
        self.tick = tick
        self.listener = open_listener(parse_address(listen))
        self.control_listener = open_listener(parse_address(control)) if control else None
        self.run_command = run_command
        self.client = None
        self.control_clients = {}

    def announce(self):
        """Print the address as the first line; the control address as the second."""
        print("%s:%d" % self.listener.getsockname(), flush=True)
        if self.control_listener:
            print("control %s:%d" % self.control_listener.getsockname(), flush=True)

    def run(self):
        """Serve until Ctrl-C."""
        self.announce()
        try:
            while True:
                self.step()
        except KeyboardInterrupt:
            pass

    def step(self):
        """Wait for bytes or for the clock, then deal with what came."""
        ready, _, _ = select.select(self._watched(), [], [], self._timeout())
        now = time.monotonic()
        self.tick(now)
        if self.client in ready:
            self._read_client(now)
        elif self.listener in ready:
            self._accept_client()
        self._check_deadline(now)
        for sock in ready:
            if sock is self.control_listener:
                self.control_clients[sock.accept()[0]] = b""
            elif sock in self.control_clients:
                self._read_control(sock)

    def _watched(self):
        socks = [self.listener if self.client is None else self.client]
        if self.control_listener:
            socks.append(self.control_listener)
        return socks + list(self.control_clients)

    def _timeout(self):
        deadline = self.session.deadline()
        if deadline is None:
            return TICK
        return max(0.0, min(TICK, deadline - time.monotonic()))

    def _accept_client(self):
        self.client, _ = self.listener.accept()
        self.client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.client.settimeout(5.0)
        self.session.open()

    def _read_client(self, now):
        try:
            data = self.client.recv(CHUNK)
        except OSError:
            data = b""
        if data:
            self._send(self.session.receive(data, now))
        else:
            self._drop_client()

    def _check_deadline(self, now):
        deadline = self.session.deadline()
        if deadline is not None and now >= deadline:
            self._send(self.session.expire(now))

    def _send(self, data):
        if not data or self.client is None:
            return
        try:
            self.client.sendall(data)
        except OSError:
            self._drop_client()

    def _drop_client(self):
        self.client.close()
        self.client = None
        self.session.close()

    def _read_control(self, sock):
        try:
            data = sock.recv(CHUNK)
        except OSError:
            data = b""
        if not data:
            del self.control_clients[sock]
            sock.close()
            return
        *lines, rest = (self.control_clients[sock] + data).split(b"\n")
        self.control_clients[sock] = rest
        for line in lines:
            answer = self._answer_control(line.decode("ascii", "replace").split())
            try:
                sock.sendall(answer.encode() + b"\n")
            except OSError:
                pass

    def _answer_control(self, words):
        try:
            return self.run_command(words) or "ok"
        except (ValueError, KeyError, IndexError, TypeError) as error:
            return "error: %r" % (error,)
