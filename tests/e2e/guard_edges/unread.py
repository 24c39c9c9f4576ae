"""Output that is not read."""

import os
import subprocess

from guarded import PORT
from program import environment, eventually


def full_pipe():
    """A pipe that takes nothing any more: its ends."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    try:
        while True:
            os.write(writer, b"x" * 512)
    except BlockingIOError:
        pass
    os.set_blocking(writer, True)
    return reader, writer


def stopped_terminal():
    """A terminal on which Ctrl-S was pressed: its ends."""
    keys, screen = os.openpty()
    os.write(keys, b"\x13")
    return keys, screen


def closed_pipe():
    """A pipe whose reader is gone."""
    reader, writer = os.pipe()
    os.close(reader)
    return os.open(os.devnull, os.O_RDONLY), writer


UNREAD = {"full": full_pipe, "terminal": stopped_terminal, "closed": closed_pipe}


class Mute:
    """A guard whose output goes where a test wants it."""

    def __init__(self, motorlink, protocol, drives, serve, output, *arguments):
        words = ["guard", protocol, "-p", PORT[protocol](drives), "--serve", serve, *arguments]
        self.ends = output()
        try:
            self.process = subprocess.Popen(
                [motorlink, *words, "--json"],
                stdin=subprocess.DEVNULL, stdout=self.ends[1], stderr=self.ends[1], env=environment(),
            )
        finally:
            os.close(self.ends[1])
        path = serve.partition(":")[2]
        eventually(lambda: os.path.lexists(path), "the served port")
        self.port = f"unix:{path}" if serve.startswith("unix") else path

    def end(self):
        self.process.kill()
        self.process.wait()
        os.close(self.ends[0])
