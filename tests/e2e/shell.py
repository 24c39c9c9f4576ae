"""Runs the shell lines of a page beside simulated drives."""

import re
import shlex
import signal
import subprocess
import threading
from pathlib import Path

from blocks import REPOSITORY

#: Ports of real devices, and the simulated ones that stand in for them.
DEVICES = [
    (re.compile(r"\b(?:slcan:/dev/\w+|socketcan:can\d)"), "slcan:./can0"),
    (re.compile(r"(?:serial:)?/dev/(?:serial/by-id/[\w.-]+|tty\w+\d)"), "./st0"),
]
EXIT = re.compile(r"#\s*exit (\d+)\s*$")
#: A line takes no longer, s.
LIMIT = 300


def simulated(text):
    """The text with simulated drives in place of real devices."""
    for device, port in DEVICES:
        text = device.sub(port, text)
    return text


def lines(text):
    """The commands of a block with the exit code that each has to have."""
    for line in text.replace("\\\n", " ").splitlines():
        code = EXIT.search(line)
        words = shlex.split(line, comments=True)
        if words:
            yield simulated(line), words, int(code[1]) if code else 0


def serves(words):
    """Whether a command serves ports until it is ended."""
    if words[:2] == ["motorlink", "guard"]:
        return "--prove" not in words
    return words[:2] == ["motorlink", "sim"] and not {"run", "presets"} & set(words)


def runs_on(words):
    """Whether a command ends with Ctrl-C only."""
    return serves(words) or ("--every" in words and "--count" not in words)


class Shell:
    """A shell in a folder. What it started in the background ends with it."""

    def __init__(self, folder, environment):
        self.folder, self.environment = folder, environment
        self.background = []

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for command in reversed(self.background):
            command.interrupt()

    def run(self, line, words, expected):
        """Runs a line; an AssertionError says how it failed."""
        if words[0] == "make":
            done = subprocess.run(["make", "--dry-run", *words[1:]], cwd=REPOSITORY,
                                  capture_output=True, text=True, timeout=LIMIT)
            assert done.returncode == 0, f"{line}\n{done.stderr}"
            return
        if words[0] == "export":
            self.environment = {**self.environment, **dict(simulated(w).split("=", 1) for w in words[1:])}
            return
        if words[-1] == "&":
            command = Command(line.split("#")[0].rstrip().removesuffix("&"), self)
            self.background.append(command)
            command.output(announcements(words))
            return
        command = Command(line, self)
        if runs_on(words):
            command.output(announcements(words) if serves(words) else 2)
            command.interrupt()
        code = command.wait()
        allowed = {0, 130} if runs_on(words) else {expected}
        assert code in allowed, f"exit code {code}, not {expected}: {line}\n{command.said()}"


def announcements(words):
    """How many lines a command that serves prints when its ports are ready."""
    return max(1, sum(word in ("--st", "--rmd", "--serve") for word in words))


class Command:
    """A command line that runs."""

    def __init__(self, line, shell):
        self.line = line
        self.process = subprocess.Popen(
            ["bash", "-c", f"set -o pipefail; exec {line}" if "|" not in line else line],
            cwd=shell.folder,
            env=shell.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.lines = []
        self.news = threading.Condition()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            with self.news:
                self.lines.append(line)
                self.news.notify_all()

    def output(self, count):
        """Waits for `count` lines of output."""
        with self.news:
            arrived = self.news.wait_for(lambda: len(self.lines) >= count, LIMIT)
        assert arrived, f"{count} lines were expected: {self.line}\n{self.said()}"

    def interrupt(self):
        """Ctrl-C, and waits for the end."""
        self.process.send_signal(signal.SIGINT)
        self.wait()

    def wait(self):
        """The exit code."""
        try:
            return self.process.wait(LIMIT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise AssertionError(f"it does not end: {self.line}\n{self.said()}") from None
        finally:
            self.reader.join(5)

    def said(self):
        return "".join(self.lines[-40:])
