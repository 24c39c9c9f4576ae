"""The program as a whole: the demo, ports, readers that have enough."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import time
from xml.etree import ElementTree

import pytest

from program import environment

DEMO_ENDS_WITHIN = 30


def test_the_demo_tells_its_story_and_draws_its_screen_during_the_fault(run, tmp_path):
    (tmp_path / "tmp").mkdir()
    words = ("demo", "--picture", tmp_path / "demo.svg")
    message = run(*words, within=DEMO_ENDS_WITHIN, TMPDIR=str(tmp_path / "tmp")).ended(0)
    assert "\x1b" not in message.out
    for said in (r"1500 rpm", r"-1000 rpm", r"RMD motor 1 .*°", r"BREAK_IN", r"FAULT_ACK"):
        assert re.search(said, message.out), said
    summary = message.out.partition("What you saw:")[2]
    assert len(re.findall(r"^  - ", summary, re.MULTILINE)) >= 5
    assert re.search(r"\d+ exchanges in \d+ s", summary)
    assert list((tmp_path / "tmp").iterdir()) == [], "nothing is left behind"
    texts = [text.text for text in ElementTree.parse(tmp_path / "demo.svg").getroot().iter()]
    assert any("FAULT_OVER BREAK_IN" in text for text in texts if text), texts


def test_the_demo_draws_a_table_on_a_terminal_of_any_width_and_ends_by_itself(motorlink):
    screen, code = on_a_terminal([motorlink, "demo"], columns=60)
    assert code == 0
    drawn = screen.partition("What you saw:")[0]
    lines = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", drawn).splitlines()
    assert max(map(len, lines)) <= 60, "nothing is cut by the terminal"
    assert any(re.search(r"motor +state +speed +current$", line) for line in lines)
    assert any(re.search(r"ST 1 +RUN +-?\d+ rpm +-?\d+ s16A$", line) for line in lines)
    assert any(re.search(r"ST 1 +FAULT_OVER BREAK_IN +-?\d+ rpm", line) for line in lines)
    assert "\x1b[" in screen, "the table is drawn in place"
    assert "What you saw:" in screen
    assert screen.rfind("\x1b[?25h") > screen.rfind("\x1b[?25l"), "the cursor is shown again"


@pytest.mark.parametrize("variables", [{"TERM": "dumb"}, {"NO_COLOR": "1"}])
def test_ctrl_c_during_the_demo_stops_the_motors_and_plain_lines_stay_plain(motorlink, tmp_path, variables):
    variables = {**variables, "TMPDIR": str(tmp_path)}
    screen, code = on_a_terminal([motorlink, "demo"], until=r"ST 1 +RUN", variables=variables)
    assert code == 130 and "\x1b" not in screen
    assert "motor 1 acknowledged its stop" in screen
    assert "may still turn" not in screen
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


def on_a_terminal(arguments, columns=100, until=None, variables=()):
    """Runs a program on a terminal; gives what it drew and its exit code. With `until` it gets a Ctrl-C when
    it has drawn this."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    inherited = {key: value for key, value in environment().items() if key != "NO_COLOR"}
    variables = {**inherited, "TERM": "xterm-256color", **dict(variables)}
    process = subprocess.Popen(
        arguments, stdin=theirs, stdout=theirs, stderr=theirs, env=variables, start_new_session=True
    )
    os.close(theirs)
    drawn, deadline = b"", time.monotonic() + DEMO_ENDS_WITHIN
    try:
        while select.select([ours], [], [], max(0, deadline - time.monotonic()))[0]:
            try:
                drawn += os.read(ours, 65536)
            except OSError:  # Linux' way to say that the other side is closed.
                break
            if until and re.search(until, drawn.decode(errors="replace")):
                process.send_signal(signal.SIGINT)
                until = None
        return drawn.decode(), process.wait(5)
    finally:
        process.kill()
        process.wait()
        os.close(ours)


def test_ports_lists_what_is_connected(run):
    for port in run("ports", "--json").ended(0).lines:
        assert set(port) == {"port", "kind", "description", "stable_path", "problem"}
    assert run("ports").ended(0).out


@pytest.mark.parametrize("command", ["st -p sim: get STATUS --every 5ms", "completions bash"])
def test_a_reader_that_has_enough_ends_the_program_quietly(piped, command):
    done = piped(command, "| head -n 2 >/dev/null", within=20)
    assert (done.code, done.err) == (0, "")
