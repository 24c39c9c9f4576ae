"""Output that is not read, and a supervisor that does not listen."""

import json
import socket

import pytest

from guarded import rests, turns
from program import eventually


@pytest.mark.parametrize(["protocol", "output"], [("st", "full"), ("rmd", "terminal"), ("st", "closed")])
def test_a_guard_whose_output_nobody_reads_guards_on_and_ends(bench, mute, client, protocol, output):
    drives = bench(protocol)
    process = mute(protocol, drives, output)
    program = client(protocol, process.port, "poll")
    turns(drives, protocol)
    program.kill()
    rests(drives, protocol)
    client(protocol, process.port)
    turns(drives, protocol)
    process.process.terminate()
    assert process.process.wait(15) == 0
    rests(drives, protocol)


def test_a_thousand_refused_programs_freeze_no_guard(bench, start, client):
    """Each event is a line on stderr, which is not read."""
    drives = bench("st")
    words = ["guard", "-p", drives.st, "--serve", "tcp-listen:127.0.0.1:0"]
    process = start(*words)
    announced = json.loads(process.line(0))
    host, _, number = announced["path"].rpartition(":")
    program = client("st", announced["path"])
    turns(drives, "st")
    # The reader of this test blocks, like a stopped shell.
    with process._news:
        for _ in range(1500):
            socket.create_connection((host, int(number)), timeout=5).close()
        program.kill()
        rests(drives, "st")
    process.says("lines were dropped here")
    process.interrupt()
    assert process.wait() == 0


def test_a_supervisor_that_does_not_listen_does_not_hold_up_a_guard(bench, start, client, tmp_path):
    drives = bench("st")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        variables = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "40000"}
        serve = f"unix-listen:{tmp_path}/held"
        process = start("guard", "-p", drives.st, "--serve", serve, **variables)
        process.line(0)
        assert systemd.recv(4096) == b"READY=1\n"
        began = drives.do("state")["t"]
        eventually(lambda: drives.do("state")["t"] > began + 1, "the socket is full")
        program = client("st", f"unix:{tmp_path}/held")
        turns(drives, "st")
        program.kill()
        rests(drives, "st")
        heard = {systemd.recv(4096).split(b"=")[0] for _ in range(10)}
        assert b"WATCHDOG" in heard
        process.interrupt()
        assert process.wait() == 0
