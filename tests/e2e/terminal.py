"""A program in a terminal: its keys, and its screen as a person sees it."""

import copy
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import termios
import threading

import pyte

from program import environment, eventually

#: What the terminal gets after all that a program wrote. It shows nothing.
LAST = b"\0"
KEYS = {
    "up": "\x1b[A", "down": "\x1b[B", "enter": "\r", "esc": "\x1b", "backspace": "\x7f", "F12": "\x1b[24~",
    "space": " ", "ctrl-c": "\x03", "ctrl-z": "\x1a", "end": "\x1b[F", "home": "\x1b[H",
    "page-up": "\x1b[5~", "page-down": "\x1b[6~",
}


class Terminal:
    """A program on a pty of its own, whose output is read continuously. A variable that is None is unset."""

    def __init__(self, words, columns=80, lines=24, folder=None, **variables):
        self.ours, theirs = pty.openpty()
        self._before = termios.tcgetattr(theirs)
        self.screen = pyte.Screen(columns, lines)
        self._stream = pyte.ByteStream(self.screen)
        self._lock = threading.Lock()
        self.raw = b""
        self._set_size(columns, lines)
        found = environment({"TERM": "xterm-256color", **variables})
        self.process = subprocess.Popen(
            words, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            env={name: value for name, value in found.items() if value is not None},
        )
        self._theirs = theirs
        self._ended = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        while not self._ended.is_set():
            ready, _, _ = select.select([self.ours], [], [], 0.05)
            if not ready:
                continue
            try:
                said = os.read(self.ours, 65536)
            except OSError:
                return
            with self._lock:
                # In this order: who waits for the last bytes reads the screen next.
                self._stream.feed(said)
                self.raw += said

    def _set_size(self, columns, lines):
        fcntl.ioctl(self.ours, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def resize(self, columns, lines):
        with self._lock:
            self.screen.resize(lines, columns)
        self._set_size(columns, lines)

    def clear(self):
        """Clears the screen, as a shell may after a stop of the program."""
        with self._lock:
            self.screen.reset()

    @property
    def lines(self):
        """What is on the screen, a line each."""
        with self._lock:
            return [line.rstrip() for line in self.screen.display]

    def frozen(self):
        """A copy of the screen."""
        with self._lock:
            return copy.deepcopy(self.screen)

    @property
    def text(self):
        return "\n".join(self.lines)

    def bold(self, text):
        """Whether the line with `text` is bold there."""
        with self._lock:
            for number, line in enumerate(self.screen.display):
                if text in line:
                    return self.screen.buffer[number][line.index(text)].bold
        return False

    @property
    def is_as_before(self):
        """Whether the terminal is as it was before the program: not raw, on its first screen."""
        with self._lock:
            left, entered = self.raw.rfind(b"\x1b[?1049l"), self.raw.rfind(b"\x1b[?1049h")
        return termios.tcgetattr(self._theirs) == self._before and left > entered

    def press(self, *keys):
        """Types keys, by name or as text. Wait for what Esc does: with a key behind it, it is another key."""
        for key in keys:
            os.write(self.ours, KEYS.get(key, key).encode())

    def shows(self, *texts, within=20):
        """Waits until each text is on the screen."""
        try:
            eventually(lambda: all(text in self.text for text in texts), texts, within)
        except AssertionError as error:
            raise AssertionError(f"{error}; the screen:\n{self.text}") from None

    def shows_no(self, text, within=20):
        """Waits until a text is no longer on the screen."""
        try:
            eventually(lambda: text not in self.text, f"no `{text}`", within)
        except AssertionError as error:
            raise AssertionError(f"{error}; the screen:\n{self.text}") from None

    def line_of(self, text):
        """The first line with a text."""
        return next((line for line in self.lines if text in line), "")

    def signal(self, number):
        os.kill(self.process.pid, number)

    def wait(self, within=20):
        """Waits for the end, and for all that the program wrote; gives the exit code."""
        code = self.process.wait(within)
        if not self._ended.is_set():
            os.write(self._theirs, LAST)
            eventually(lambda: self.raw.endswith(LAST), "the end of the output", within)
        return code

    def hang_up(self):
        """Takes the terminal away, as when its window is closed."""
        self._close()

    def _close(self):
        if not self._ended.is_set():
            self._ended.set()
            self._reader.join()
            os.close(self._theirs)
            os.close(self.ours)

    def end(self):
        if self.process.poll() is None:
            self.signal(signal.SIGCONT)
            self.process.terminate()
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self._close()
