"""`-p share:PATH/LINE`: the command line on a drive that other programs use at the same time."""

import csv
import os
import signal
import struct

import pytest

from program import eventually
from sharing import Client, event
from test_json import check
from terminal import Terminal

#: Programs that are killed. ROUNDS=50 for more.
ROUNDS = int(os.environ.get("ROUNDS", "3"))
PERIOD = 0.01


@pytest.fixture
def drives(sim):
    """Simulated drives on a port of each kind."""
    return sim()


@pytest.fixture
def share(start, drives, tmp_path):
    """A share of these drives: `st` and `rmd` are its lines as ports, `path` is its socket."""
    path = tmp_path / "share"
    # A busy machine may be late with a reply.
    words = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--at", f"unix:{path}", "--timeout", "2s"]
    running = start("share", *words, "--json")
    running.line(0)
    running.path, running.st, running.rmd = path, f"share:{path}/st0", f"share:{path}/rmd0"
    return running


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
    found = run(*st, "scan", "--json").ended(0)
    check(found.out + found.err)
    assert found.json["finding"] == "drive" and "baud" not in found.json
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
    assert "BAD_FRAME_ID" in run(*st, "raw", "0x1f").ended(1).err


def test_rmd_commands_work_as_on_a_port_of_their_own(share, run, direct):
    rmd = ["rmd", "-p", share.rmd]
    assert len(run(*rmd, "scan", "--json").ended(0).lines) == 4
    run(*rmd, "--id", "2", "status").ended(0)
    run(*rmd, "--id", "2", "pid").ended(0)
    run(*rmd, "--id", "2", "dump").ended(0)
    run(*rmd, "torque4", "0", "0", "0", "0.1").ended(0)
    run(*rmd, "status", "--every", "20ms", "--count", "10").ended(0)
    assert "does not answer" in run(*rmd, "--id", "9", "status").ended(3).err
    eventually(lambda: all(abs(direct.dps(motor)) < 5 for motor in (1, 2, 3, 4)), "motors that stop")


def test_what_cannot_be_opened_is_refused_with_words(share, run, tmp_path, start, drives):
    def error(port, code, *more):
        return run("st", "-p", port, *more, "get", "STATUS").ended(code).err

    assert "lacks the line behind the path" in error(f"share:{share.path}", 2)
    assert "no share is at" in error(f"share:{tmp_path}/none/st0", 3)
    assert "its lines are st0, rmd0" in error(f"share:{share.path}/st1", 3)
    assert "cannot be used as a serial line" in error(share.rmd, 2)
    other = error(share.st, 2, "--profile", "mcsdk-5.4")
    assert "profile spec; nothing was sent" in other and "--profile spec" in other


@pytest.mark.parametrize("protocol", ["st", "rmd"])
def test_the_kit_needs_a_port_of_its_own(share, run, protocol):
    told = run("conformance", protocol, "-p", getattr(share, protocol)).ended(2)
    assert "the kit needs a port of its own; end the share" in told.err and told.out == ""


def test_a_latch_refuses_motion_and_the_readers_go_on(share, run, start, direct):
    reads = start("st", "-p", share.st, "get", "STATUS", "--every", "10ms", "--json")
    reads.line(3)
    direct.ask("latch")
    for command in (["start"], ["ramp", "1000", "100"]):
        refused = run("st", "-p", share.st, *command).ended(1)
        assert "looks latched: motion is refused until the latch is released" in refused.err
    turned = run("rmd", "-p", share.rmd, "--id", "1", "speed", "100").ended(1)
    assert "motion is refused until the latch is released" in turned.err
    run("st", "-p", share.st, "stop").ended(0)
    direct.ask("release")
    run("st", "-p", share.st, "start").ended(0)
    reads.more_lines()
    reads.interrupt()
    assert reads.wait() in (0, 130)


def test_a_motor_stops_when_the_command_that_started_it_has_ended(share, run, direct):
    said = "the share stops the motor now, because this command ends"
    assert said in run("st", "-p", share.st, "start", "--ramp", "1500", "100").ended(0).err
    direct.until(event("stopped", line="st0", motor=1))
    assert said in run("rmd", "-p", share.rmd, "--id", "3", "speed", "300").ended(0).err
    direct.until(event("stopped", line="rmd0", motor=3))
    waited = run("rmd", "-p", share.rmd, "--id", "3", "position", "90", "--max-speed", "360", "--wait")
    assert said not in waited.ended(0).err
    assert said not in run("st", "-p", share.st, "ramp", "1000", "100").ended(0).err
    eventually(lambda: abs(direct.rpm()) < 30 and abs(direct.dps(3)) < 5, "motors that stop")


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_move_that_waits_leaves_a_motor_that_another_program_has_moved_since(share, start, direct, sent):
    for _ in range(max(3, ROUNDS)):
        waits = start("rmd", "-p", share.rmd, "--id", 2, "position", 720000, "--max-speed", 100, "--wait")
        eventually(lambda: direct.dps(2) > 50, "a motor that turns")
        assert direct.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 30000))["kind"] == "answer"
        waits.process.send_signal(sent)
        assert waits.wait() != 0
        eventually(lambda: direct.dps(2) > 290, "the speed of the other program")
        assert not any("was stopped" in line for line in waits.err), waits.err
        assert direct.ask("stop", motor={"line": "rmd0", "motor": 2})["kind"] == "answer"
        eventually(lambda: abs(direct.dps(2)) < 5, "a motor at rest")


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


def test_a_stop_that_a_drive_does_not_confirm_is_an_error(share, run, drives, direct):
    direct.command("rmd0", 9, 0xA2, *7 * [0])
    done = run("share", "stop", "--at", f"unix:{share.path}", within=60).ended(3)
    assert "rmd0, motor 9: it may still be turning" in done.out
    assert "not all confirmed" in done.err


def test_a_stop_of_all_says_where_no_motor_was_found_and_is_no_error_for_it(share, run, drives):
    run("rmd", "-p", share.rmd, "--id", "1", "status").ended(0)
    for motor in (20, 21):
        run("rmd", "-p", share.rmd, "--id", motor, "status").ended(3)
    run("st", "-p", share.st, "-m", 5, "status").ended(1)
    # What the first stop learned does not change the answer to the second one.
    for _ in range(2):
        done = run("share", "stop", "--at", f"unix:{share.path}", within=60).ended(0)
        assert "rmd0, motor 1: it confirmed the stop" in done.out
        assert "rmd0: no motor was found at 20 to 21\n" in done.out
        assert "st0: no motor was found at 5\n" in done.out
        assert "may still be turning" not in done.out
    said = run("share", "stop", "--at", f"unix:{share.path}", "--json", within=60).ended(0)
    assert '"event":"no-motor","line":"rmd0"' in said.out.replace(" ", "")


def test_after_the_kill_of_a_share_commands_say_so_at_once(share, start, run, drives):
    reads = start("st", "-p", share.st, "get", "STATUS", "--every", "10ms")
    reads.line(3)
    share.process.send_signal(signal.SIGKILL)
    share.wait()
    reads.until(lambda: any("the share is gone" in line for line in reads.err), "why it does not read")
    new = start("share", "-p", drives.st, "--at", f"unix:{share.path}")
    new.line(0)
    reads.more_lines()
    reads.interrupt()
    reads.wait()


def test_a_program_that_ends_when_its_share_is_just_back_stops_its_motor(start, drives, tmp_path):
    """The pause before a lost port is opened again does not hold for stops."""
    path = tmp_path / "share"
    words = ["-p", f"slcan:{drives.can}", "--at", f"unix:{path}", "--timeout", "2s", "--json"]
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


def test_a_frozen_share_is_not_taken_for_a_silent_drive(start, drives, tmp_path):
    words = ["-p", drives.st, "--at", f"unix:{tmp_path}/share", "--timeout", "100ms"]
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


def test_reads_that_wait_too_long_in_a_share_do_not_end_a_program(start, sim, tmp_path):
    drives = sim(rmd=())
    share = start("share", "-p", drives.st, "--at", f"unix:{tmp_path}/share", "--timeout", "1s")
    share.line(0)
    # Requests of one wait behind those of the other.
    reads = [
        start("st", "-p", f"share:{tmp_path}/share/st0", "get", "STATUS", "--every", "10ms", "--json")
        for _ in range(2)
    ]
    for program in reads:
        program.line(3)
    looks = Client(tmp_path / "share", "looks")
    drives.process.send_signal(signal.SIGSTOP)
    try:
        for program in reads:
            program.until(lambda: any('"outage"' in line for line in program.out), "an outage")
        expired = 0
        while expired < 3:
            expired += looks.command("st0", 1, 2, 2, within=0.3).get("reason") == "expired"
    finally:
        drives.process.send_signal(signal.SIGCONT)
    for program in reads:
        program.until(lambda: any('"back"' in line for line in program.out), "the end of the outage")
        program.more_lines()


def test_a_guard_is_refused_in_front_of_a_share(share, run, tmp_path):
    guard = run("guard", "st", "-p", share.st, "--serve", f"pty:{tmp_path}/guarded").ended(2)
    assert "use it without a guard" in guard.err


def test_watch_shows_and_stops_motors_of_a_share(share, motorlink, direct):
    direct.command("st0", 1, 7, *struct.pack("<iH", 1500, 100))
    direct.command("st0", 1, 3, 1)
    eventually(lambda: direct.rpm() > 1000, "a motor that turns")
    terminal = Terminal([motorlink, "watch", "-p", share.st, "-p", share.rmd], 80, 24)
    try:
        terminal.shows("st0:1", "rmd0:2", "RUN", "6 motors on 2 ports")
        terminal.press("space")
        eventually(lambda: is_idle(direct), "a motor that stops")
        terminal.press("q")
        assert terminal.wait() == 0
    finally:
        terminal.end()


def read_times(path):
    """The times of the samples of a CSV file, s."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [float(row["t [s]"]) for row in rows]


def gaps(times):
    """The times between samples, s."""
    return sorted(b - a for a, b in zip(times, times[1:]))


def test_each_program_can_be_killed_and_the_others_go_on(share, start, direct, tmp_path):
    every = ["--every", f"{PERIOD * 1000:.0f}ms"]
    st = ["st", "-p", share.st, "get", "SPEED_MEAS", "TORQUE_MEAS", "SPEED_KP"]

    def watches():
        viewer = start(*st, *every, "--json")
        viewer.line(2)
        return viewer

    def records(name):
        path = tmp_path / f"{name}.csv"
        recorder = start(*st, *every, "--csv", str(path))
        recorder.line(3)
        return recorder, path

    def tunes():
        client = Client(share.path, "tuner")
        gain = client.command("st0", 1, 1, 5, *struct.pack("<h", 200))
        ramp = client.command("st0", 1, 7, *struct.pack("<iH", 1500, 100))
        start = client.command("st0", 1, 3, 1)
        assert {it["kind"] for it in (gain, ramp, start)} == {"answer"}, (gain, ramp, start)
        return client

    recorder, path = records("all")
    viewer, tuner = watches(), tunes()
    for turn in range(ROUNDS):
        eventually(lambda: direct.rpm() > 1000, "a motor that turns")
        # A program that only looks is killed: the motor keeps turning.
        other, _ = records(f"killed-{turn}")
        other.process.kill()
        viewer.process.kill()
        viewer.wait()
        viewer = watches()
        assert direct.rpm() > 1000
        # The tuner leaves: its motor stops, and the recorder continues.
        tuner.socket.close()
        eventually(lambda: is_idle(direct), "a motor that stops")
        tuner = tunes()
    recorder.interrupt()
    recorder.wait()
    times = gaps(read_times(path))
    assert len(times) > 50 * ROUNDS
    late = sum(gap > 2 * PERIOD for gap in times)
    print(f"{ROUNDS} rounds, {len(times)} gaps, {late} above {2 * PERIOD} s, longest {times[-1]:.3f} s")


def test_the_socket_of_a_share_is_no_port_of_a_drive(share, run):
    for words in (["st", "-p", f"unix:{share.path}"], ["rmd", "-p", f"slcan:unix:{share.path}"]):
        failed = run(*words, "status").ended(3)
        assert "write -p share:PATH/st0, or /rmd0 for RMD motors" in failed.err, failed.err
