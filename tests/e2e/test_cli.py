"""The program as a whole: demo, ports, completions, manual."""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from xml.etree import ElementTree

import pytest

from program import environment

DEMO_ENDS_WITHIN = 30


# The demo.


def test_the_demo_tells_its_story_in_lines_and_ends_by_itself(run, tmp_path):
    message = run("demo", within=DEMO_ENDS_WITHIN, TMPDIR=str(tmp_path)).ended(0)
    assert "\x1b" not in message.out
    for said in (r"1500 rpm", r"-1000 rpm", r"RMD motor 1 .*°", r"BREAK_IN", r"FAULT_ACK"):
        assert re.search(said, message.out), said
    summary = message.out.partition("What you saw:")[2]
    assert len(re.findall(r"^  - ", summary, re.MULTILINE)) >= 5
    assert re.search(r"\d+ exchanges in \d+ s", summary)
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


@pytest.mark.parametrize("columns", [80, 50, 20])
def test_the_demo_draws_a_table_on_a_terminal_and_ends_by_itself(motorlink, columns):
    screen, code = on_a_terminal([motorlink, "demo"], DEMO_ENDS_WITHIN, columns)
    assert code == 0
    drawn = screen.partition("What you saw:")[0]
    lines = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", drawn).splitlines()
    assert max(map(len, lines)) <= columns, "nothing is cut by the terminal"
    if columns == 80:
        assert re.search(r"motor +state +speed +current +temp +voltage", screen)
        assert any(re.search(r"ST 1 +RUN +-?\d+ rpm +-?\d+ s16A +\d+ °C +\d+ V$", line) for line in lines)
        assert any(re.search(r"ST 1 +FAULT_OVER BREAK_IN +-?\d+ rpm", line) for line in lines)
    if columns == 50:
        assert any(re.search(r"ST 1 +RUN +-?\d+ rpm$", line) for line in lines)
    assert "\x1b[" in screen, "the table is drawn in place"
    assert "What you saw:" in screen
    assert screen.rfind("\x1b[?25h") > screen.rfind("\x1b[?25l"), "the cursor is shown again"


@pytest.mark.parametrize("variables", [{"TERM": "dumb"}, {"TERM": ""}, {"NO_COLOR": "1"}])
def test_the_demo_prints_plain_lines_where_a_terminal_cannot_or_shall_not_draw(motorlink, variables):
    screen, code = on_a_terminal([motorlink, "demo"], DEMO_ENDS_WITHIN, variables=variables)
    assert code == 0 and "\x1b" not in screen and "What you saw:" in screen


def test_the_demo_draws_its_screen_during_the_fault(run, tmp_path):
    run("demo", "--picture", tmp_path / "demo.svg", within=DEMO_ENDS_WITHIN).ended(0)
    texts = [text.text for text in ElementTree.parse(tmp_path / "demo.svg").getroot().iter()]
    assert any("FAULT_OVER BREAK_IN" in text for text in texts if text), texts


def test_ctrl_c_during_the_demo_stops_the_motors(start, tmp_path):
    demo = start("demo", TMPDIR=str(tmp_path))
    demo.until(lambda: any(re.search(r"ST 1 +RUN", line) for line in demo.out), "ST 1 in RUN")
    demo.interrupt()
    assert demo.wait() == 130
    assert any("motor 1 acknowledged its stop" in line for line in demo.err), demo.err
    assert not any("may still turn" in line for line in demo.err), demo.err
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


def on_a_terminal(arguments, within, columns=100, variables=()):
    """Runs a program on a terminal; gives what it drew and its exit code."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    inherited = {key: value for key, value in environment().items() if key != "NO_COLOR"}
    variables = {**inherited, "TERM": "xterm-256color", **dict(variables)}
    process = subprocess.Popen(
        arguments, stdin=theirs, stdout=theirs, stderr=theirs, env=variables, start_new_session=True
    )
    os.close(theirs)
    drawn, deadline = b"", time.monotonic() + within
    try:
        while select.select([ours], [], [], max(0, deadline - time.monotonic()))[0]:
            try:
                drawn += os.read(ours, 65536)
            except OSError:  # Linux' way to say that the other side is closed.
                break
        return drawn.decode(), process.wait(5)
    finally:
        process.kill()
        process.wait()
        os.close(ours)


# The rest.


def test_ports_lists_what_is_connected(run):
    for port in run("ports", "--json").ended(0).lines:
        assert set(port) == {"port", "kind", "description", "stable_path", "problem"}
    assert run("ports").ended(0).out


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completions_know_the_commands(run, shell):
    script = run("completions", shell).ended(0).out
    assert "torque4" in script and "fault-ack" in script


def test_bash_takes_the_completions(run):
    script = run("completions", "bash").ended(0).out
    ask = "COMP_WORDS=(motorlink st rev) COMP_CWORD=2; _motorlink motorlink rev st"
    done = subprocess.run(
        ["bash"],
        input=f'{script}\n{ask}; echo "${{COMPREPLY[@]}}"\n',
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.split() == ["revup-data", "revup"], done.stderr


def test_the_manual_has_a_page_for_every_command(run, tmp_path):
    run("man", tmp_path / "man").ended(0)
    pages = {page.name for page in (tmp_path / "man").iterdir()}
    assert {"motorlink.1", "motorlink-st-ramp.1", "motorlink-rmd-torque4.1"} <= pages
    assert ".TH" in (tmp_path / "man" / "motorlink-sim.1").read_text()


def test_help_tells_the_exit_codes_and_every_command_has_help(run):
    assert "Exit codes: 0 done, 1 the drive refused" in run("--help").ended(0).out
    for kind in ("st", "rmd"):
        table = run(kind, "--help").ended(0).out.partition("Commands:")[2].partition("Options:")[0]
        commands = set(re.findall(r"^  ([a-z0-9-]+)  ", table, re.MULTILINE)) - {"help"}
        assert len(commands) > 10
        for command in commands:
            assert "Usage:" in run(kind, command, "--help").ended(0).out


def test_an_unknown_command_is_a_usage_error_with_the_nearest(run):
    message = run("st", "statuss").ended(2).err
    assert "'status'" in message


@pytest.mark.parametrize(
    "words",
    [
        "st -p sim: get STATUS --every 100",
        "st -p sim: --timeout 100 get STATUS",
        "rmd -p sim: angle --every 100",
        "rmd -p sim: --timeout 100 angle",
        "guard st -p sim: --silence 100",
        "conformance host st --serve pty:./st0 --timeout 100 -- true",
        "conformance host st --serve pty:./st0 --limit 100 -- true",
    ],
)
def test_a_time_without_a_unit_is_refused_with_both_spellings(run, words):
    message = run(*words.split()).ended(2).err
    assert "the unit is missing: write 100ms or 100s" in message


@pytest.mark.parametrize(
    "command",
    [
        "st -p sim: get STATUS --every 5ms",
        "st registers",
        "rmd -p sim: angle --every 5ms",
        "completions bash",
    ],
)
def test_a_reader_that_has_enough_ends_the_program_quietly(piped, command):
    done = piped(command, "| head -n 2 >/dev/null", within=20)
    assert (done.code, done.err) == (0, "")
