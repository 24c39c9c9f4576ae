"""Lines of a running share that are opened and closed, by a program that speaks its messages."""

import json
import signal
import struct

import pytest

from program import eventually
from sharing import Client, event


@pytest.fixture
def drives(sim):
    """Simulated drives on a port of each kind."""
    return sim()


@pytest.fixture
def share(start, drives, tmp_path):
    """A share of the ST drive alone; its socket is `path`."""
    path = tmp_path / "share"
    running = start("share", "-p", drives.st, "--at", f"unix:{path}", "--timeout", "2s", "--json")
    ready = json.loads(running.line(0))
    assert [line["line"] for line in ready["lines"]] == ["st0"]
    running.path = path
    return running


def names(client):
    """The names of the lines."""
    return [line["line"] for line in client.ask("lines")["lines"]]


def test_a_line_is_opened_turned_and_closed(share, drives):
    program, other = Client(share.path, "opens"), Client(share.path, "sees")
    port = f"slcan:{drives.can}"
    answer = program.ask("open", port=port, protocol="rmd", timeout=10)
    assert (answer["to"], answer["line"]) == ("open", "rmd0")
    assert other.until(event("opened", line="rmd0", by="opens"))["message"] == f"rmd0: opens opened {port}"
    assert names(other) == ["st0", "rmd0"]
    turned = program.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
    assert turned["kind"] == "answer"
    eventually(lambda: program.dps(2, "rmd0") > 100, "a motor that turns")
    closed = other.ask("close", line="rmd0")
    assert closed["motors"] == [{"line": "rmd0", "motor": 2}]
    program.until(event("stopped", line="rmd0", motor=2))
    program.until(event("closed", line="rmd0", by="sees"))
    assert names(program) == ["st0"]
    assert program.command("rmd0", 2, 0x9C, *7 * [0])["reason"] == "usage"
    # The port is free, and the name is not used again.
    assert program.ask("open", port=port, protocol="rmd", timeout=10)["line"] == "rmd1"
    eventually(lambda: program.dps(2, "rmd1") == 0, "a motor that stands")


def turn(program):
    """Turns the ST motor."""
    assert program.command("st0", 1, 7, *struct.pack("<iH", 1000, 100))["kind"] == "answer"
    assert program.command("st0", 1, 3, 1)["kind"] == "answer"


def turned(run, drives):
    """Turns the ST motor of drives that no program has open."""
    run("st", "-p", drives.st, "start", "--ramp", "1000", "100ms").ended(0)
    eventually(lambda: drives.motor(1)["speed_rpm"] > 500, "a motor that turns")


def stands(program, line):
    """Waits until ST motor 1 of a line stands."""
    eventually(lambda: abs(program.rpm(line=line)) < 30, "a motor that stands")


def test_a_line_that_is_closed_while_its_drive_is_away_owes_its_stop(share, drives, sim, run):
    program = Client(share.path, "turns")
    turn(program)
    drives.end()
    program.until(event("lost", line="st0"))
    assert program.ask("close", line="st0")["motors"][0]["failure"]
    other = sim("--stdin", rmd=())
    turned(run, other)
    assert program.ask("open", port=other.st, protocol="st", timeout=10)["line"] == "st1"
    stands(program, "st1")


def test_a_drive_that_comes_under_a_latch_is_stopped(share, drives, sim, run, tmp_path):
    program = Client(share.path, "latches")
    link = tmp_path / "drive"
    link.symlink_to(drives.st)
    assert program.ask("close", line="st0")["to"] == "close"
    assert program.ask("open", port=str(link), protocol="st", timeout=10)["line"] == "st1"
    program.ask("latch")
    assert "failure" not in program.ask("stop")["motors"][0]
    other = sim("--stdin", st=(f"pty:{tmp_path}/other",), rmd=())
    turned(run, other)
    (tmp_path / "next").symlink_to(other.st)
    (tmp_path / "next").replace(link)
    drives.end()
    program.until(event("back", line="st1"))
    stands(program, "st1")


def test_a_close_says_that_a_motor_did_not_confirm(share, drives):
    program = Client(share.path, "turns")
    turn(program)
    drives.process.send_signal(signal.SIGSTOP)
    try:
        closed = program.ask("close", line="st0")
    finally:
        drives.process.send_signal(signal.SIGCONT)
    assert [(one["line"], one["motor"]) for one in closed["motors"]] == [("st0", 1)]
    assert closed["motors"][0]["failure"]
    program.until(event("stop-failed", line="st0", motor=1))
    assert names(program) == []


def test_what_is_no_device_or_taken_is_refused(share, drives, tmp_path):
    program = Client(share.path, "tries")
    file = tmp_path / "file"
    file.write_text("as it was")
    for port in (str(file), f"slcan:{file}", f"sim:{file}", f"unix:{share.path}", f"share:{share.path}/st0", "/dev/null"):
        refusal = program.ask("open", port=port, protocol="st")
        assert refusal["reason"] == "usage" and "is not opened" in refusal["message"], refusal
    assert file.read_text() == "as it was"
    refusal = program.ask("open", port=drives.st, protocol="st")
    assert refusal["message"].endswith("is open already: it is the line st0")
    assert program.ask("open", port="tcp:127.0.0.1:1", protocol="st")["reason"] == "line"
    assert program.ask("ports")["to"] == "ports"
    assert program.ask("close", line="st7")["reason"] == "usage"
    assert names(program) == ["st0"]


def test_a_recording_goes_on_when_a_line_is_closed(share, drives, start, tmp_path):
    program = Client(share.path, "closes")
    assert program.ask("open", port=f"slcan:{drives.can}", protocol="rmd", timeout=10)["line"] == "rmd0"
    file = tmp_path / "run.mcap"
    ports = [f"share:{share.path}/{line}" for line in ("st0", "rmd0")]
    recorder = start("record", "-p", ports[0], "-p", ports[1], "-o", str(file), "--json")
    rates = lambda line: [one for one in program.ask("rates")["rates"] if one["line"] == line and one["achieved"] > 0]
    eventually(lambda: rates("rmd0") and rates("st0"), "signals of both lines that are read", within=30)
    assert program.ask("close", line="rmd0")["to"] == "close"
    eventually(lambda: rates("st0"), "a line that is read on")
    assert recorder.process.poll() is None
    recorder.interrupt()
    assert recorder.wait() == 0
