"""Lines on which a test is the program, or sits between guard and drive."""

import os
import select
import threading
import time
import tty

from program import eventually


class RawLine:
    """A pty, byte by byte."""

    def __init__(self, path):
        self.end = os.open(path, os.O_RDWR | os.O_NOCTTY)

    def say(self, words, *answers):
        """Writes, and reads until one of the answers came."""
        os.write(self.end, words)
        came = b""
        while not any(answer in came for answer in answers):
            assert select.select([self.end], [], [], 10)[0], came
            came += os.read(self.end, 4096)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.end)


class Between:
    """A pty before a drive's line. A thread for each direction runs `carry` until the end."""

    def __init__(self, path, drive):
        self.path = path
        self.master, self.keep = os.openpty()
        tty.setraw(self.keep)
        os.symlink(os.ttyname(self.keep), path)
        self.drive = os.open(drive, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.drive)
        self.running = True
        self.threads = [
            threading.Thread(target=self.carry, args=(self.master, self.drive, True), daemon=True),
            threading.Thread(target=self.carry, args=(self.drive, self.master, False), daemon=True),
        ]
        for thread in self.threads:
            thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.running = False
        for thread in self.threads:
            thread.join()
        for end in (self.master, self.keep, self.drive):
            os.close(end)


class SlowLine(Between):
    """Drives behind a pty that carries 115200 baud and notes what passes."""

    BYTES_PER_SECOND = 11_520

    def __init__(self, path, protocol, drives):
        self.protocol, self.drives = protocol, drives
        self.st, self.can = str(path), str(path)
        self.seen, self.lock = [], threading.Lock()
        super().__init__(path, drives.st if protocol == "st" else drives.can)

    def carry(self, source, target, is_sent):
        while self.running:
            if not select.select([source], [], [], 0.05)[0]:
                continue
            try:
                data = os.read(source, 64)
            except OSError:
                time.sleep(0.01)
                continue
            if is_sent:
                time.sleep(len(data) / self.BYTES_PER_SECOND)
                with self.lock:
                    self.seen.append((time.monotonic(), data))
            os.write(target, data)

    def sent(self):
        with self.lock:
            return list(self.seen)

    def flooded(self):
        eventually(lambda: sum(len(data) for _, data in self.sent()) > 6_000, "a flood", within=30)

    def stopped(self):
        stop = bytes([0x23, 0x01, 0x02, 0x26]) if self.protocol == "st" else b"t141881"
        eventually(lambda: stop in b"".join(data for _, data in self.sent()), "the stop", within=30)

    def bytes_since(self, began):
        return sum(len(data) for at, data in self.sent() if at > began)


class Meddler(Between):
    """A serial line to a drive on which replies are late and a line of slcan is lost."""

    def __init__(self, path, drive, delay):
        self.delay = delay
        self.sent, self.losing, self.lost = b"", [], []
        super().__init__(path, drive)

    def carry(self, source, target, is_sent):
        pending = b""
        while self.running:
            if not select.select([source], [], [], 0.05)[0]:
                continue
            pending += os.read(source, 4096)
            *lines, pending = pending.split(b"\r")
            for line in lines:
                if is_sent and self.losing and line.startswith(self.losing[0]):
                    self.lost.append(self.losing.pop(0))
                    continue
                if is_sent:
                    self.sent += line + b"\r"
                else:
                    time.sleep(self.delay)
                os.write(target, line + b"\r")

    def passed(self, beginning):
        return beginning in self.sent

    def lose(self, beginning):
        self.losing.append(beginning)

    def is_lost(self, beginning):
        return beginning in self.lost
