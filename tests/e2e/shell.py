"""Runs shell lines of help and pages beside simulated drives."""

import re
import shlex
import socket
import subprocess
import time
from pathlib import Path

from program import Running
from terminal import Terminal

REPOSITORY = Path(__file__).parents[2]
#: Ports of real devices, and the simulated ones that replace them.
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
    if words[:2] == ["motorlink", "share"]:
        return not asks_a_share(words)
    if words[:2] in (["motorlink", "replay"], ["motorlink", "monitor"], ["motorlink", "node"]):
        return True
    if words[:3] == ["motorlink", "fleet", "router"]:
        return True
    return words[:2] == ["motorlink", "sim"] and not {"run", "presets"} & set(words)


def asks_a_share(words):
    """Whether a command needs a share that runs."""
    if words[:2] == ["motorlink", "monitor"]:
        return "--share" in words
    return words[:2] == ["motorlink", "share"] and bool({"stop", "latch", "release"} & set(words))


def asks_a_node(words):
    """Whether a command needs a node that runs."""
    return words[:2] == ["motorlink", "fleet"] and words[2] not in ("init", "router")


def free_port():
    """A TCP port that is free now."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def is_view(words):
    """Whether a command shows a view in a terminal, which `q` ends."""
    return words[:2] == ["motorlink", "watch"]


def runs_on(words):
    """Whether a command ends with Ctrl-C only."""
    return serves(words) or ("--every" in words and "--count" not in words)


class Shell:
    """A shell in a folder, with variables for its commands. What it started in the background ends with
    it."""

    def __init__(self, folder, **variables):
        # Simulated motors answer late on a loaded machine.
        own = {"MOTORLINK_RMD_TIMEOUT": "1s"}
        # Shells that run at the same time have networks of their own.
        own["MOTORLINK_NETWORK"] = f"tcp/127.0.0.1:{free_port()}"
        self.folder, self.variables = folder, {**own, **variables}
        self.background = []

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for command in reversed(self.background):
            command.interrupt()
            command.end()

    def run(self, line, words, expected):
        """Runs a line; an AssertionError says how it failed."""
        if words[0] == "make":
            done = subprocess.run(["make", "--dry-run", *words[1:]], cwd=REPOSITORY,
                                  capture_output=True, text=True, timeout=LIMIT)
            assert done.returncode == 0, f"{line}\n{done.stderr}"
            return
        if words[0] == "export":
            self.variables.update(simulated(word).split("=", 1) for word in words[1:])
            return
        if words[-1] == "&":
            command = self._start(line.split("#")[0].rstrip().removesuffix("&"))
            self.background.append(command)
            command.line(announcements(words) - 1, LIMIT)
            return
        if is_view(words):
            return self._view(line, expected)
        code, command = self._ended(line, words)
        # A person waits until the motor of an earlier line rests.
        deadline = time.monotonic() + LIMIT
        while any("it is still stopping" in text for text in command.err) and time.monotonic() < deadline:
            code, command = self._ended(line, words)
        said = "\n".join([*command.out[-40:], *command.err[-40:]])
        assert code == expected, f"exit code {code}, not {expected}: {line}\n{said}"

    def _ended(self, line, words):
        """Runs a line to its end. Gives the exit code and what it said."""
        command = self._start(line)
        try:
            if runs_on(words):
                command.line(announcements(words) - 1 if serves(words) else 0, LIMIT)
                command.interrupt()
            return command.wait(LIMIT), command
        finally:
            command.end()

    def _view(self, line, expected):
        view = Terminal(["bash", "-c", f"exec {line}"], folder=self.folder, **self.variables)
        try:
            view.shows("q quit", within=LIMIT)
            view.press("q")
            code = view.wait(LIMIT)
        finally:
            view.end()
        assert code == expected, f"exit code {code}, not {expected}: {line}\n{view.text}"

    def _start(self, line):
        return Running(
            ["bash", "-c", f"set -o pipefail; {line}" if "|" in line else f"exec {line}"],
            stdin=subprocess.PIPE,
            folder=self.folder,
            **self.variables,
        )


def announcements(words):
    """How many lines a command that serves prints when its ports are ready."""
    return max(1, sum(word in ("--st", "--rmd", "--serve") for word in words))
