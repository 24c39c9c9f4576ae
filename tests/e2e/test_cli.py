"""The program as a whole: the demo, ports, readers that have enough."""

import re
import signal

import pytest

from program import eventually
from terminal import LAST, Terminal

DEMO_ENDS_WITHIN = 120


def demo_on_a_terminal(motorlink, columns=100, until=None, **variables):
    """What the demo drew, and its exit code. With `until` it gets a Ctrl-C when it has drawn this."""
    terminal = Terminal([motorlink, "demo"], columns, 40, **{"NO_COLOR": None, **variables})
    try:
        if until:
            eventually(lambda: re.search(until, terminal.raw.decode(errors="replace")), until, DEMO_ENDS_WITHIN)
            terminal.signal(signal.SIGINT)
        code = terminal.wait(DEMO_ENDS_WITHIN)
        return terminal.raw.removesuffix(LAST).decode(), code
    finally:
        terminal.end()


def test_the_demo_tells_its_story(run, tmp_path):
    message = run("demo", within=DEMO_ENDS_WITHIN, TMPDIR=str(tmp_path)).ended(0)
    assert "\x1b" not in message.out
    for said in (r"1500 rpm", r"-1000 rpm", r"RMD motor 1 .*°", r"BREAK_IN", r"FAULT_ACK"):
        assert re.search(said, message.out), said
    summary = message.out.partition("What you saw:")[2]
    assert len(re.findall(r"^  - ", summary, re.MULTILINE)) >= 5
    assert re.search(r"\d+ exchanges in \d+ s", summary)
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


def test_the_demo_draws_a_table_on_a_terminal_of_any_width_and_ends_by_itself(motorlink):
    screen, code = demo_on_a_terminal(motorlink, columns=60)
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
    screen, code = demo_on_a_terminal(motorlink, until=r"ST 1 +RUN", TMPDIR=str(tmp_path), **variables)
    assert code == 130 and "\x1b" not in screen
    assert "motor 1 acknowledged its stop" in screen
    assert "may still turn" not in screen
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


def test_ports_lists_what_is_connected(run):
    for port in run("ports", "--json").ended(0).lines:
        assert set(port) == {"port", "kind", "description", "stable_path", "problem"}
    assert run("ports").ended(0).out


@pytest.mark.parametrize("command", ["st -p sim: get STATUS --every 5ms", "completions bash"])
def test_a_reader_that_has_enough_ends_the_program_quietly(piped, command):
    done = piped(command, "| head -n 2 >/dev/null", within=20)
    assert (done.code, done.err) == (0, "")


def test_the_log_says_what_is_sent_and_results_stay(run):
    words = ("st", "-p", "sim:", "get", "SPEED_MEAS")
    quiet, told = run(*words).ended(0), run("--log", "debug", *words).ended(0)
    assert (told.out, quiet.err) == (quiet.out, "")
    assert re.search(r"T\S+Z DEBUG \S+: begins port=sim motor=1 request=reading SPEED_MEAS", told.err)
    warned = run(*words, MOTORLINK_LOG="warn").ended(0)
    assert warned.err == ""
    # A stop is sent, whatever the variable says.
    wrong = run("st", "-p", "sim:", "stop", MOTORLINK_LOG="loud").ended(0)
    assert "MOTORLINK_LOG is off, error, warn, info or debug" in wrong.err


def test_the_log_of_a_share_says_who_joins_and_what_stops(start, run, sim, tmp_path):
    socket = tmp_path / "share"
    share = start("share", "-p", sim().st, "--at", f"unix:{socket}", MOTORLINK_LOG="info")
    share.line(0)
    run("st", "-p", f"share:{socket}/st0", "start").ended(0)
    share.says("st0, motor 1: it confirmed the stop")
    assert any(" joined" in line for line in share.err)
