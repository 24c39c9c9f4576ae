"""Running the program, and waiting for what it says."""

import json
import os
import signal
import subprocess
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass


#: Options for simulated drives: a busy machine may be late with a reply.
PATIENT = ("--timeout", "1s")


def environment(variables=()):
    """The environment without what the user of this machine has set for motorlink."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("MOTORLINK_")}
    return {**inherited, "NO_COLOR": "1", **dict(variables)}


def eventually(condition, what, within=10):
    """Waits until `condition` is true and gives what it gave."""
    deadline = time.monotonic() + within
    while True:
        value = condition()
        if value:
            return value
        assert time.monotonic() < deadline, f"{what} was expected within {within} s"
        time.sleep(0.005)


@contextmanager
def children():
    """Programs of a test's own: `start(words, said)` gives one that has said a line. They are ended."""
    started = []

    def start(words, said, **options):
        process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options
        )
        started.append(process)
        assert process.stdout.readline() == f"{said}\n"
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def plain(line):
    """The values of a line of JSON as numbers, or as names where they are bits."""
    return {
        name: value.get("names", value.get("value", value.get("digits")))
        for name, value in line["values"].items()
    }


def says_halted(line, part, before=""):
    """Whether a guard says, behind these words, that a part has accepted its stop."""
    return any(f"{before}{part} {what}" in line for what in ("is stop", "acknowledged its stop ("))


@dataclass
class Outcome:
    """How a run of the program ended."""

    code: int
    out: str
    err: str

    @property
    def lines(self):
        """Output as a JSON value a line."""
        return [json.loads(line) for line in self.out.splitlines()]

    @property
    def json(self):
        """Output that is one line of JSON."""
        (value,) = self.lines
        return value

    @property
    def values(self):
        """The values of output that is one line of JSON."""
        return plain(self.json)

    def ended(self, code):
        """Checks the exit code; gives the outcome back."""
        assert self.code == code, f"exit code {self.code}, not {code}\n{self.out}\n{self.err}"
        assert (code == 0) == ("error:" not in self.err and '"exit":' not in self.err), self.err
        assert "panicked" not in self.err, self.err
        return self


class Running:
    """A program that runs during the test. Its output is read continuously. `first` is called in its
    process before it begins."""

    def __init__(self, arguments, stdin=subprocess.DEVNULL, folder=None, first=None, **variables):
        self.process = subprocess.Popen(
            arguments,
            cwd=folder,
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(variables),
            preexec_fn=first,
        )
        self.out, self.err = [], []
        self._news = threading.Condition()
        self._readers = [
            threading.Thread(target=self._read, args=pair, daemon=True)
            for pair in ((self.process.stdout, self.out), (self.process.stderr, self.err))
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream, lines):
        for line in stream:
            with self._news:
                lines.append(line.rstrip("\n"))
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    def until(self, condition, what, within=15):
        """Waits until `condition` of the output so far is true."""
        with self._news:
            if self._news.wait_for(condition, within):
                return
        said = "\n".join(self.out[-20:] + self.err)
        raise AssertionError(f"{what} was expected within {within} s; it said:\n{said}")

    def line(self, number, within=15):
        """Line `number` of the output, waited for."""
        self.until(lambda: len(self.out) > number, f"line {number + 1} of the output", within)
        return self.out[number]

    def says(self, text, within=15):
        """Waits for `text` on stderr."""
        self.until(lambda: any(text in line for line in self.err), f"`{text}` on stderr", within)

    def says_halted(self, part, before=""):
        """Waits until a guard says that a part has accepted its stop."""
        self.until(lambda: any(says_halted(line, part, before) for line in self.err), f"the stop of {part}")

    def more_lines(self, count=3):
        """Waits for `count` further lines of output and gives them."""
        seen = len(self.out)
        self.until(lambda: len(self.out) >= seen + count, f"{count} more lines")
        return self.out[seen:]

    def interrupt(self):
        """Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    def kill(self):
        """Ends it without a chance to tidy up."""
        self.process.kill()
        self.wait()

    def wait(self, within=15):
        """Waits for the end; gives the exit code."""
        code = self.process.wait(within)
        for reader in self._readers:
            reader.join(within)
        return code

    def end(self):
        """Ends it, if it still runs."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(5)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self.wait()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            if stream:
                stream.close()


class Sim(Running):
    """`motorlink sim` with its ports announced."""

    def __init__(self, arguments, ports):
        super().__init__(arguments, stdin=subprocess.PIPE)
        self.ports = [json.loads(self.line(number)) for number in range(ports)]
        self._answers = ports

    def _served(self, protocol, scheme):
        return next(
            port
            for port in self.ports
            if port["protocol"] == protocol and port["port"].startswith(scheme)
        )

    @property
    def st(self):
        """The pty of the ST drive, by its link."""
        return self._served("st", "pty:")["port"].removeprefix("pty:")

    @property
    def st_address(self):
        """HOST:PORT of the ST drive."""
        return self._served("st", "tcp-listen:")["path"]

    @property
    def can(self):
        """The slcan pty of the CAN bus, by its link."""
        return self._served("rmd", "slcan-pty:")["port"].removeprefix("slcan-pty:")

    @property
    def can_address(self):
        """HOST:PORT of the CAN bus."""
        return self._served("rmd", "tcp-listen:")["path"]

    def port(self, kind):
        """What -p takes for a port of this kind."""
        return {
            "pty": lambda: self.st,
            "tcp": lambda: f"tcp:{self.st_address}",
            "slcan": lambda: f"slcan:{self.can}",
            "slcan:tcp": lambda: f"slcan:tcp:{self.can_address}",
            "sim": lambda: "sim:",
        }[kind]()

    def say(self, line):
        """Sends a line to stdin; gives the answer."""
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer = json.loads(self.line(self._answers))
        self._answers += 1
        return answer

    def command(self, command, **fields):
        """Obeyed or not: `sim.command("supply", motor=1, volts=5)`."""
        return self.say(json.dumps({"command": command, **fields}))

    def do(self, command, **fields):
        """A command that is obeyed."""
        answer = self.command(command, **fields)
        assert answer["ok"], answer
        return answer

    def motor(self, number, port=None):
        """What is really going on in a motor."""
        fields = {"port": port} if port else {}
        (bench,) = self.do("state", **fields)["state"]
        return next(motor for motor in bench["motors"] if motor["motor"] == number)


def serving(motorlink, folder):
    """Starts `motorlink sim`s on ports in `folder` and ends them."""
    started = []

    def sim(*arguments, st=("pty",), rmd=("slcan-pty",)):
        """Serves a port of each kind: `pty` and `slcan-pty` are st0 and can0 in the folder."""
        names = {"pty": f"pty:{folder}/st0", "slcan-pty": f"slcan-pty:{folder}/can0"}
        names["tcp"] = "tcp-listen:127.0.0.1:0"
        ports = [word for kind in st for word in ("--st", names.get(kind, kind))]
        ports += [word for kind in rmd for word in ("--rmd", names.get(kind, kind))]
        drives = Sim([motorlink, "sim", *map(str, arguments), *ports], len(ports) // 2)
        started.append(drives)
        return drives

    yield sim
    for drives in started:
        drives.end()
