"""`-p share:PATH/LINE`: the command line on a drive that other programs use at the same time."""

import os
import signal
import struct
import time

import pytest

from program import eventually
from sharing import Client, event

#: Programs that are killed. ROUNDS=50 for more.
ROUNDS = int(os.environ.get("ROUNDS", "1"))


@pytest.fixture
def share(shares):
    return shares()


@pytest.fixture
def direct(share):
    """A program that speaks the messages, to look at the drives."""
    return Client(share.path, "looks")


def is_idle(client):
    """Whether the ST motor rests and can be started."""
    return client.status() == 0


def test_st_commands_work_as_on_a_port_of_their_own(share, run, tmp_path):
    st = ["st", "-p", share.st]
    assert run(*st, "get", "STATUS", "--json").values["STATUS"] == 0
    run(*st, "set", "SPEED_KP", "123").ended(0)
    assert run(*st, "get", "SPEED_KP", "--json").values["SPEED_KP"] == 123
    assert "SDK" in run(*st, "info").ended(0).out
    scan = run(*st, "scan").ended(0)
    assert "SDK" in scan.out and "baud" not in scan.out and "has no baud rate" in scan.err
    run(*st, "segment", "0", "SPEED_MEAS", "STATUS").ended(0)
    run(*st, "dump", str(tmp_path / "m.toml")).ended(0)
    run(*st, "set", "SPEED_KP", "124").ended(0)
    run(*st, "diff", str(tmp_path / "m.toml")).ended(1)
    run(*st, "restore", str(tmp_path / "m.toml")).ended(0)
    assert run(*st, "get", "SPEED_KP", "--json").values["SPEED_KP"] == 123
    samples = run(*st, "get", "SPEED_MEAS", "STATUS", "--every", "10ms", "--count", "20", "--json").ended(0)
    assert len(samples.lines) >= 20
    refused = run(*st, "-m", "5", "stop").ended(1)
    assert "BAD_MOTOR_SELECTED" in refused.err and "no motor of this number" in refused.err
    assert "may still be turning" not in refused.err


def test_what_cannot_be_opened_is_refused_with_words(share, run, tmp_path):
    def error(port, code, *more):
        return run("st", "-p", port, *more, "get", "STATUS").ended(code).err

    assert "lacks the line behind the path" in error(f"share:{share.path}", 2)
    assert "no share is at" in error(f"share:{tmp_path}/none/st0", 3)
    assert "its lines are st0, rmd0" in error(f"share:{share.path}/st1", 3)
    assert "cannot be used as a serial line" in error(share.rmd, 2)
    other = error(share.st, 2, "--profile", "mcsdk-5.4")
    assert "profile spec; nothing was sent" in other and "--profile spec" in other
    told = run("conformance", "st", "-p", share.st).ended(2)
    assert "the kit needs a port of its own; end the share" in told.err and told.out == ""
    guard = run("guard", "st", "-p", share.st, "--serve", f"pty:{tmp_path}/guarded").ended(2)
    assert "use it without a guard" in guard.err
    # A share's socket does not speak a drive's protocol.
    failed = run("st", "-p", f"unix:{share.path}", "status").ended(3)
    assert "write -p share:PATH/st0, or /rmd0 for RMD motors" in failed.err, failed.err


def test_a_motor_stops_when_the_command_that_started_it_has_ended(share, run, direct):
    said = "the share stops the motor now, because this command ends"
    assert said in run("st", "-p", share.st, "start", "--ramp", "1500", "100").ended(0).err
    direct.until(event("stopped", line="st0", motor=1))
    assert said in run("rmd", "-p", share.rmd, "--id", "3", "speed", "300").ended(0).err
    direct.until(event("stopped", line="rmd0", motor=3))
    waited = run("rmd", "-p", share.rmd, "--id", "3", "position", "90", "--max-speed", "360", "--wait")
    assert said not in waited.ended(0).err
    assert said in run("st", "-p", share.st, "ramp", "1000", "100").ended(0).err
    assert said in run("rmd", "-p", share.rmd, "--id", "3", "raw", "A2 00 00 00 30 75 00 00").ended(0).err
    torques = ["torque4", 0.1, 0.1, 0, 0, "--expect", "1,2"]
    assert said in run("rmd", "-p", share.rmd, *torques).ended(0).err
    assert said not in run("rmd", "-p", share.rmd, "--id", "3", "status").ended(0).err
    # Two shares would own the same motor.
    for holder in ("share", "node"):
        twice = run(holder, "-p", share.rmd).ended(2)
        assert "a share or node already holds this line" in twice.err
    eventually(lambda: abs(direct.rpm()) < 30 and abs(direct.dps(3)) < 5, "motors that stop")


def test_a_move_that_waits_leaves_a_motor_that_another_program_has_moved_since(share, start, direct):
    for _ in range(ROUNDS):
        waits = start("rmd", "-p", share.rmd, "--id", 2, "position", 720000, "--max-speed", 100, "--wait")
        eventually(lambda: direct.dps(2) > 50, "a motor that turns")
        assert direct.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 30000))["kind"] == "answer"
        waits.interrupt()
        assert waits.wait() != 0
        eventually(lambda: direct.dps(2) > 290, "the speed of the other program")
        assert not any("was stopped" in line for line in waits.err), waits.err
        assert direct.ask("stop", motor={"line": "rmd0", "motor": 2})["kind"] == "answer"
        eventually(lambda: abs(direct.dps(2)) < 5, "a motor at rest")


def test_the_motor_of_a_program_that_is_frozen_stops(share, start, direct):
    times = []
    for _ in range(ROUNDS):
        waits = start("rmd", "-p", share.rmd, "--id", 2, "position", 720000, "--max-speed", 100, "--wait")
        eventually(lambda: direct.dps(2) > 50, "a motor that turns")
        began = time.monotonic()
        waits.process.send_signal(signal.SIGSTOP)
        left = direct.until(lambda it: event("left")(it) and "no sign of life" in it["message"])
        times.append(time.monotonic() - began)
        eventually(lambda: abs(direct.dps(2)) < 5, "a motor that stops")
        waits.process.send_signal(signal.SIGCONT)
        assert waits.wait() == 3
        waits.says("no sign of life for 2")
        assert left["by"].startswith("motorlink "), left
    print(f"\nfrozen: {sorted(round(it, 2) for it in times)}")
    # Signs of life come late by up to a quarter of the deadline.
    assert min(times) > 1.4


def test_a_command_latches_stops_and_releases(share, run, direct):
    at = ["--at", f"unix:{share.path}"]
    direct.command("st0", 1, 3, 1)
    run("share", "latch", *at).ended(0)
    refused = run("st", "-p", share.st, "start").ended(1).err
    assert "motion is refused until the latch is released" in refused
    assert "`motorlink share release --at unix:PATH` releases the latch" in refused
    assert "st0, motor 1: it confirmed the stop" in run("share", "stop", *at).ended(0).out
    eventually(lambda: is_idle(direct), "a motor that rests")
    run("share", "release", *at).ended(0)
    run("st", "-p", share.st, "start").ended(0)
    missing = run("share", "release", "--at", f"unix:{share.path}-not").ended(3).err
    assert "is --at that of a running `motorlink share`?" in missing


def test_a_stop_that_a_drive_does_not_confirm_is_an_error(share, run, direct):
    direct.command("rmd0", 9, 0xA2, *7 * [0])
    done = run("share", "stop", "--at", f"unix:{share.path}").ended(3)
    assert "rmd0, motor 9: it may still be turning" in done.out
    assert "not all confirmed" in done.err


def test_a_stop_of_all_says_where_no_motor_was_found_and_is_no_error_for_it(share, run):
    run("rmd", "-p", share.rmd, "--id", "1", "status").ended(0)
    for motor in (20, 21):
        run("rmd", "-p", share.rmd, "--id", motor, "status").ended(3)
    run("st", "-p", share.st, "-m", 5, "status").ended(1)
    done = run("share", "stop", "--at", f"unix:{share.path}").ended(0)
    assert "rmd0, motor 1: it confirmed the stop" in done.out
    assert "rmd0: no motor was found at 20 to 21\n" in done.out
    assert "st0: no motor was found at 5\n" in done.out
    assert "may still be turning" not in done.out
    said = run("share", "stop", "--at", f"unix:{share.path}", "--json").ended(0)
    assert '"event":"no-motor","line":"rmd0"' in said.out.replace(" ", "")


def test_after_the_kill_of_a_share_commands_say_so_at_once(share, start):
    reads = start("st", "-p", share.st, "get", "STATUS", "--every", "10ms")
    reads.line(3)
    share.process.send_signal(signal.SIGKILL)
    share.wait()
    reads.until(lambda: any("the share is gone" in line for line in reads.err), "why it does not read")
    new = start("share", "-p", share.drives.st, "--at", f"unix:{share.path}")
    new.line(0)
    reads.more_lines()
    reads.interrupt()
    reads.wait()


def test_a_program_that_ends_when_its_share_is_just_back_stops_its_motor(start, sim, tmp_path):
    """The pause before a lost port is opened again does not hold for stops."""
    path = tmp_path / "share"
    words = ["-p", f"slcan:{sim().can}", "--at", f"unix:{path}", "--timeout", "2s", "--json"]
    share = start("share", *words)
    share.line(0)
    for _ in range(ROUNDS):
        waits = start("rmd", "-p", f"share:{path}/rmd0", "--id", 2, "position", 720000, "--max-speed", 100, "--wait")
        eventually(lambda: Client(path, "looks").dps(2) > 50, "a motor that turns")
        share.kill()
        share = start("share", *words)
        share.line(0)
        waits.interrupt()
        waits.wait()
        direct = Client(path, "looks")
        eventually(lambda direct=direct: abs(direct.dps(2)) < 5, "a motor at rest")


def test_a_frozen_share_is_not_taken_for_a_silent_drive(start, sim, tmp_path):
    words = ["-p", sim().st, "--at", f"unix:{tmp_path}/share", "--timeout", "100ms"]
    share = start("share", *words)
    share.line(0)
    reads = start("st", "-p", f"share:{tmp_path}/share/st0", "get", "STATUS", "--every", "10ms")
    reads.line(3)
    share.process.send_signal(signal.SIGSTOP)
    try:
        reads.until(
            lambda: any("does not answer: is it stopped" in line for line in reads.err), "why", within=30
        )
    finally:
        share.process.send_signal(signal.SIGCONT)
    reads.more_lines()
