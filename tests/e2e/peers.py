"""What else may be at the far end of a serial line: nothing, noise, other protocols."""

import contextlib
import os
import random
import select
import socket
import threading
import time
import tty
from contextlib import contextmanager


@contextmanager
def device(link, answer=lambda received: b""):
    """A serial device behind `link`. `answer(received)` gives the bytes that it sends then, or None
    to unplug it; without it the device is silent."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.symlink(os.ttyname(theirs), link)
    stopped, stop = os.pipe()

    def serve():
        while stopped not in select.select([ours, stopped], [], [])[0]:
            reply = answer(os.read(ours, 4096))
            if reply is None:
                os.unlink(link)
                break
            os.write(ours, reply)
        os.close(theirs)
        os.close(ours)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield str(link)
    finally:
        os.close(stop)
        thread.join()
        os.close(stopped)


_generator = random.Random(1)


def noise(_received):
    """The answer of a device that speaks at another rate."""
    return _generator.randbytes(40)


def slcan_adapter(deliver):
    """The answers of an slcan adapter. `deliver(frame)` is given each frame that the host sends, in
    the words of slcan, and gives the frames that then come from the bus."""
    pending = bytearray()

    def answer(received):
        pending.extend(received)
        *lines, rest = bytes(pending).split(b"\r")
        pending[:] = rest
        reply = b""
        for line in lines:
            if line.startswith(b"t"):
                frames = deliver(line.decode())
                reply += b"z\r" + b"".join(frame.encode() + b"\r" for frame in frames)
            else:
                reply += b"\r"
        return reply

    return answer


class Plug:
    """A cable to a drive at HOST:PORT that can be unplugged and plugged in again. `port` is what -p takes.
    `delivered` is when the host last got something from the drive: ns since 1970."""

    def __init__(self, address):
        host, port = address.rsplit(":", 1)
        self._drive = (host, int(port))
        self._ours = ("127.0.0.1", 0)
        self.delivered = 0
        self.plug_in()
        self._ours = self._listener.getsockname()
        self.port = "tcp:{}:{}".format(*self._ours)

    def plug_in(self):
        self._listener = socket.create_server(self._ours)
        self._ends = []
        threading.Thread(target=self._serve, args=(self._listener, self._ends), daemon=True).start()

    def unplug(self):
        for end in [self._listener, *self._ends]:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _serve(self, listener, ends):
        with contextlib.suppress(OSError):
            while True:
                client, _ = listener.accept()
                drive = socket.create_connection(self._drive)
                ends += [client, drive]
                for source, sink in ((client, drive), (drive, client)):
                    ends_at = (source, sink, sink is client)
                    threading.Thread(target=self._carry, args=ends_at, daemon=True).start()

    def _carry(self, source, sink, is_to_host):
        with contextlib.suppress(OSError):
            while data := source.recv(4096):
                sink.sendall(data)
                if is_to_host:
                    self.delivered = time.time_ns()
            sink.shutdown(socket.SHUT_RDWR)
