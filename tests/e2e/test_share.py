"""A share of the built program: several programs on its drives, each killed, and the share itself."""

import json
import os
import random
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest

from badline import BadLine, slcan_messages
from peers import Plug
from program import eventually
from sharing import Client, are_still, event, speeds

#: Programs that are killed. ROUNDS=50 for more.
ROUNDS = int(os.environ.get("ROUNDS", "1"))
START, STOP, RUNNING = (3, 1), (3, 2), 6

#: A program that watches a motor.
WATCHES = """
import sys
sys.path.insert(0, sys.argv[2])
from sharing import Client
client = Client(sys.argv[1], "watches")
client.subscribe(("st0", 1, "SPEED_MEAS"), period=0.005)
client.until(lambda it: isinstance(it, tuple))
print("watching", flush=True)
client.until(lambda it: False)
"""

#: A program that turns ST motor 1 and RMD motor 2, says so, and waits to be killed.
TURNS = """
import struct, sys
sys.path.insert(0, sys.argv[2])
from sharing import Client
client = Client(sys.argv[1], "turns")
ramp = client.command("st0", 1, 7, *struct.pack("<iH", 1500, 100))
start = client.command("st0", 1, 3, 1)
turn = client.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
assert {it["kind"] for it in (ramp, start, turn)} == {"answer"}, (ramp, start, turn)
print("turning", flush=True)
while client.receive():
    pass
"""


@pytest.fixture
def share(shares):
    return shares("60s")


def program(code, share, said):
    """Another process that uses the share, after it has said this."""
    words = [sys.executable, "-c", code, str(share.path), str(Path(__file__).parent)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == f"{said}\n"
    return process


def killed(process):
    """Kills it with SIGKILL."""
    process.kill()
    process.communicate()


def test_the_motors_of_a_killed_program_stop_and_a_viewer_misses_nothing(share):
    viewer, tuner = Client(share.path, "viewer"), Client(share.path, "tuner")
    viewer.subscribe(("st0", 1, "SPEED_MEAS"), ("rmd0", 2, "speed_dps"), queue=100_000)
    # A motor of another program that stays.
    tuner.command("rmd0", 1, 0xA2, 0, 0, 0, *struct.pack("<i", 9000))
    times, sequences, lost = {}, {}, 0
    for _ in range(ROUNDS):
        process = program(TURNS, share, "turning")
        eventually(lambda: min(speeds(tuner)) > 300, "motors that turn")
        killed(process)
        eventually(lambda: are_still(tuner), "motors that stop")
        tuner.until(event("left", by="turns"))
    while len(times) < 2 or min(map(len, times.values())) < 30 * ROUNDS:
        group, sequence, missing, t0, columns = viewer.until(lambda it: isinstance(it, tuple))
        assert sequence == sequences.get(group, 0)
        sequences[group] = sequence + 1
        times.setdefault(group, []).extend(t0 + t for t in columns[0])
        lost += missing
    assert lost == 0
    assert tuner.dps(1) > 60
    gaps = [b - a for t in times.values() for a, b in zip(t, t[1:])]
    gaps.sort()
    late = sum(gap > 0.02 for gap in gaps)
    print(f"{ROUNDS} kills, {len(gaps)} samples each 10 ms, {late} gaps above 20 ms, longest {gaps[-1] * 1000:.0f} ms")


def test_a_killed_viewer_disturbs_nobody(share):
    tuner = Client(share.path, "tuner")
    for _ in range(ROUNDS):
        process = program(WATCHES, share, "watching")
        assert tuner.command("st0", 1, *START)["kind"] == "answer"
        killed(process)
        tuner.until(event("left", by="watches"))
        eventually(lambda: tuner.status() == RUNNING, "a motor that runs")
        assert tuner.command("st0", 1, *STOP)["kind"] == "answer"
        eventually(lambda: are_still(tuner), "motors that stop")


def test_the_stop_of_a_program_that_left_is_repeated_until_the_drive_confirms_it(start, sim, tmp_path):
    host, port = sim(st=(), rmd=("tcp",)).can_address.rsplit(":", 1)
    with BadLine((host, int(port)), slcan_messages, random.Random(1)) as line:
        path = tmp_path / "share"
        running = start("share", "-p", f"slcan:{line.port}", "--at", f"unix:{path}")
        running.line(0)
        watcher, owner = Client(path, "watcher"), Client(path, "owner")
        owner.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
        line.fate.lost = 1.0
        owner.socket.close()
        watcher.until(event("stop-failed"))
        line.fate.lost = 0.0
        watcher.until(event("stopped"))


def test_a_share_that_is_interrupted_stops_motors_and_says_so(share, run):
    process = program(TURNS, share, "turning")
    watcher = Client(share.path, "watcher")
    share.interrupt()
    assert watcher.until(lambda it: it.get("kind") == "closing")["message"] == "the share was ended"
    assert share.wait() == 0
    process.communicate()
    stopped = [json.loads(line) for line in share.out if '"stopped"' in line]
    assert {(it["line"], it["motor"]) for it in stopped} == {("st0", 1), ("rmd0", 2)}
    eventually(
        lambda: run("st", "-p", share.drives.st, "get", "SPEED_MEAS", "--json").values["SPEED_MEAS"] < 30,
        "a motor that stops",
    )
    assert not share.path.exists()


def test_a_new_share_takes_the_place_of_a_killed_one_and_stops_all_motors_that_it_turned(share, start):
    process, client = program(TURNS, share, "turning"), Client(share.path, "x")
    share.process.send_signal(signal.SIGKILL)
    share.wait()
    # Programs see the end.
    assert list(iter(client.receive, None)) is not None
    process.communicate()
    drives = share.drives
    words = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--timeout", "1s"]
    new = start("share", *words, "--at", f"unix:{share.path}")
    assert new.line(0).startswith(f"share at unix:{share.path}: st0 (serial:")
    # No program has read or commanded a motor of this share.
    operator = Client(share.path, "operator")
    motors = operator.ask("stop")["motors"]
    confirmed = {(it["line"], it["motor"]) for it in motors if "failure" not in it}
    assert confirmed >= {("st0", 1), ("rmd0", 2)}, motors
    eventually(lambda: are_still(operator), "motors at rest")


def test_a_stop_while_the_port_is_gone_is_repeated_when_it_is_back(sim, run, start, tmp_path):
    drives = sim(st=("tcp",), rmd=())
    cable, path = Plug(drives.st_address), tmp_path / "share"
    # No program of the share has started the motor.
    run("st", "-p", f"tcp:{drives.st_address}", "--timeout", "1s", "start").ended(0)
    start("share", "-p", cable.port, "--at", f"unix:{path}").line(0)
    eventually(lambda: abs(drives.motor(1)["speed_rpm"]) > 300, "a motor that turns")
    client = Client(path, "operator")
    client.command("st0", 1, 2, 2)
    cable.unplug()
    client.until(event("lost"))
    (stopped,) = client.ask("stop", motor={"line": "st0", "motor": 1})["motors"]
    assert "failure" in stopped, stopped
    cable.plug_in()
    client.until(event("stopped"))
    eventually(lambda: abs(drives.motor(1)["speed_rpm"]) < 30, "a motor at rest")
    cable.unplug()


def test_connections_that_say_nothing_lock_nobody_out(share):
    silent = [socket.socket(socket.AF_UNIX) for _ in range(200)]
    for connection in silent:
        connection.connect(str(share.path))

    def is_let_in():
        try:
            return Client(share.path, "late").ask("lines")["kind"] == "answer"
        except (AssertionError, OSError):
            return False

    eventually(is_let_in, "a place for a program")
    for connection in silent:
        connection.close()


def test_a_share_with_all_its_programs_takes_stops_and_nothing_else(share, run):
    """64 programs are the limit. A stop from a shell has a place of its own."""
    programs = [Client(share.path, f"program {number}") for number in range(64)]
    at, motor = ("--at", f"unix:{share.path}"), ("rmd", "-p", f"share:{share.path}/rmd0", "--id", 2)
    for stop in ROUNDS * [("share", "stop", *at), (*motor, "stop")]:
        programs[0].command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
        eventually(lambda: speeds(programs[0])[1] > 300, "a motor that turns")
        run(*stop).ended(0)
        eventually(lambda: abs(speeds(programs[0])[1]) < 5, "a motor at rest")
    refused = run(*motor, "speed", 100).ended(1)
    assert "the share has 64 programs, which is the limit; of others it takes only stops" in refused.err
    # Programs that come to stop, and stay, do not keep the places.
    idle = [Client(share.path, f"idle {number}") for number in range(12)]
    for _ in range(2):
        run("share", "stop", *at).ended(0)
    for connection in (*programs, *idle):
        connection.socket.close()


def test_a_share_that_was_frozen_starts_no_motor_and_stops_one(share):
    program = Client(share.path, "program")
    program.command("st0", 1, 7, *struct.pack("<iH", 1500, 100))
    program.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
    eventually(lambda: speeds(program)[1] > 300, "a motor that turns")
    share.process.send_signal(signal.SIGSTOP)
    state = Path(f"/proc/{share.process.pid}/stat")
    eventually(lambda: state.read_text().rpartition(")")[2].split()[0] == "T", "a share that is frozen")
    command = {"line": "st0", "motor": 1, "bytes": list(START), "time_to_live": 0.3}
    start, stop = program.send("command", **command), program.send("stop")
    sent = time.monotonic()
    eventually(lambda: time.monotonic() > sent + 1, "requests that are old")
    share.process.send_signal(signal.SIGCONT)
    assert program.until(lambda it: it.get("id") == start)["reason"] == "expired"
    stopped = program.until(lambda it: it.get("id") == stop)
    assert [motor.get("failure") for motor in stopped["motors"]] == [None, None], stopped
    eventually(lambda: are_still(program), "motors that stop")


def test_a_share_takes_no_place_of_others(share, run, tmp_path):
    taken = run("share", "-p", "sim:", "--at", f"unix:{share.path}").ended(3)
    assert "is served" in taken.err or "another" in taken.err, taken.err
    (tmp_path / "file").write_text("mine")
    run("share", "-p", "sim:", "--at", f"unix:{tmp_path}/file").ended(3)
    assert (tmp_path / "file").read_text() == "mine"
    run("share", "--at", f"unix:{tmp_path}/other").ended(2)
    run("share", "-p", "sim:", "--at", "tcp:1").ended(2)


def test_the_log_says_who_did_what(start, sim, tmp_path):
    drives, path = sim(), tmp_path / "share"
    words = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--at", f"unix:{path}", "--timeout", "60s"]
    running = start("share", *words)
    running.line(0)
    client = Client(path, "tuner")
    client.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
    client.command("st0", 1, *START)
    client.ask("stop", motor={"line": "st0", "motor": 1})
    client.ask("latch")
    client.socket.close()
    for said in (
        "tuner sends EXECUTE_CMD START_MOTOR",
        "st0, motor 1: tuner stops it",
        "rmd0, motor 2: tuner sends 0xA2 ",
        "rmd0, motor 2: the share stops it, because tuner has left",
        "it confirmed the stop",
        "tuner refuses motion",
        "tuner left",
    ):
        running.until(lambda: any(said in line for line in running.out), said)
    assert re.fullmatch(r"\d\d:\d\d:\d\d tuner joined", running.out[1]), running.out[1]


def test_a_drive_that_comes_under_a_latch_is_stopped(sim, start, run, tmp_path):
    drives, path, link = sim(rmd=()), tmp_path / "share", tmp_path / "drive"
    link.symlink_to(drives.st)
    start("share", "-p", link, "--at", f"unix:{path}", "--timeout", "2s").line(0)
    client = Client(path, "latches")
    client.ask("latch")
    assert "failure" not in client.ask("stop")["motors"][0]
    # Another drive, whose motor turns, comes in the place of this one.
    other = sim("--stdin", st=(f"pty:{tmp_path}/other",), rmd=())
    run("st", "-p", other.st, "start", "--ramp", "1000", "100ms").ended(0)
    eventually(lambda: other.motor(1)["speed_rpm"] > 500, "a motor that turns")
    (tmp_path / "next").symlink_to(other.st)
    (tmp_path / "next").replace(link)
    drives.end()
    client.until(event("back", line="st0"))
    eventually(lambda: abs(client.rpm()) < 30, "a motor that stands")
