"""What else may be at the far end of a serial line: nothing, noise, other protocols."""

import os
import random
import select
import threading
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
