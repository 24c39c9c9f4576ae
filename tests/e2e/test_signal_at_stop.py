"""Signals during `rmd off`, `rmd stop` and `st stop`: the first one does not end the stop."""

import signal
import threading
from contextlib import ExitStack

import pytest

from peers import device, slcan_adapter
from st_wire import EXECUTE, frame

STOPS = ("80", "81")
STOP_MOTOR = frame(1 << 5 | EXECUTE, [0x02])
#: Acknowledgments of the stop, of GET_BOARD_INFO and of GET_REG STATUS.
REPLIES = {
    STOP_MOTOR: frame(0xF0, []),
    frame(0x06, []): frame(0xF0, bytes(32)),
    frame(0x02, [0x02]): frame(0xF0, [0]),
}


class Lossy:
    """A line whose replies to stops are lost until `heals` is set."""

    def __init__(self):
        self.stop_came, self.heals = threading.Event(), threading.Event()

    def loses(self, is_stop):
        if is_stop:
            self.stop_came.set()
        return is_stop and not self.heals.is_set()

    def rmd(self, sent):
        """Stops are answered by the same frame, questions by a status."""
        identifier, code = sent[:4], sent[5:7]
        if self.loses(code in STOPS):
            return []
        return [sent if code in STOPS else f"{identifier}8{code}1900F000000000"]

    def st(self, received):
        asked = next((request for request in REPLIES if received.endswith(request)), None)
        return b"" if asked is None or self.loses(asked == STOP_MOTOR) else REPLIES[asked]


@pytest.fixture
def stopping(start, tmp_path):
    """Starts a stop on a lossy line, and returns when the drive has received it."""
    with ExitStack() as opened:

        def stopping(protocol, *words):
            line = Lossy()
            answer = slcan_adapter(line.rmd) if protocol == "rmd" else line.st
            port = opened.enter_context(device(tmp_path / "line", answer))
            port = f"slcan:{port}" if protocol == "rmd" else port
            program = start(protocol, "-p", port, "--timeout", "500ms", *words)
            assert line.stop_came.wait(15)
            return line, program

        yield stopping


@pytest.mark.parametrize(
    "words, number, done",
    [
        (("rmd", "--id", "2", "off"), signal.SIGINT, "motor 2 is off"),
        (("rmd", "--id", "2", "stop"), signal.SIGTERM, "motor 2 is stopped; `run` resumes"),
        (("rmd", "off", "--all"), signal.SIGHUP, "motor 1 is off"),
        (("st", "stop"), signal.SIGINT, "motor 1: STOP_MOTOR acknowledged"),
    ],
)
def test_a_first_signal_lets_a_stop_complete(stopping, words, number, done):
    line, program = stopping(*words)
    program.process.send_signal(number)
    line.heals.set()
    assert program.wait() == 0, program.err
    assert program.line(0) == done


@pytest.mark.parametrize(
    "words, motors",
    [
        (("rmd", "--id", "2,3", "off"), "motors 2, 3"),
        (("rmd", "off", "--all"), "all motors"),
        (("st", "stop"), "motor 1"),
    ],
)
def test_a_second_signal_ends_a_stop_and_names_the_motors(stopping, words, motors):
    _, program = stopping(*words)
    program.process.send_signal(signal.SIGINT)
    program.process.send_signal(signal.SIGTERM)
    assert program.wait() == 130
    assert any(text.startswith(f"{motors} may still be turning: ") for text in program.err), program.err
