"""Signals that a guard gets."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from guarded import ENDING, SUSPENDING, rests, turns
from program import environment, says_halted


@pytest.mark.parametrize(["protocol", "second"], [("st", signal.SIGTERM), ("rmd", signal.SIGINT)])
def test_a_second_signal_does_not_keep_the_motors_from_being_stopped(
    bench, guard, client, protocol, second
):
    for gap in (0, 0.002):
        drives = bench(protocol)
        process = guard(protocol, drives)
        client(protocol, process.port)
        turns(drives, protocol)
        process.interrupt()
        time.sleep(gap)
        for _ in range(3):
            process.process.send_signal(second)
        assert process.wait() == 0
        assert any(says_halted(text, "motor 1", "the guard ends: ") for text in process.err), process.err
        rests(drives, protocol)
        drives.end()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGRTMAX])
def test_every_signal_that_would_end_a_guard_stops_the_motors(bench, guard, client, tmp_path, number):
    drives = bench("st")
    process = guard("st", drives)
    client("st", process.port)
    turns(drives, "st")
    # The system says which signals the guard handles.
    (caught,) = re.findall("SigCgt:\t(.*)", Path(f"/proc/{process.process.pid}/status").read_text())
    assert all(int(caught, 16) >> (it - 1) & 1 for it in (*ENDING, *SUSPENDING)), caught
    process.process.send_signal(number)
    assert process.wait() == 0
    rests(drives, "st")
    assert not os.path.lexists(tmp_path / "held")


def test_a_guard_is_not_suspended(bench, guard, client):
    drives = bench("st")
    process = guard("st", drives)
    program = client("st", process.port)
    turns(drives, "st")
    process.process.send_signal(signal.SIGTSTP)
    process.says("not suspended")
    program.kill()
    rests(drives, "st")
    process.says_halted("motor 1")


def test_what_a_guard_was_told_to_ignore_does_not_end_it(bench, client, motorlink, tmp_path):
    drives = bench("st")
    words = [motorlink, "guard", "-p", drives.st, "--serve", f"pty:{tmp_path}/held"]
    process = subprocess.Popen(
        ["nohup", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=environment(),
    )
    try:
        process.stdout.readline()
        program = client("st", f"{tmp_path}/held")
        turns(drives, "st")
        for _ in range(3):
            process.send_signal(signal.SIGHUP)
        assert drives.motor(1)["status"] == "RUN"
        program.kill()
        rests(drives, "st")
        assert process.poll() is None
        process.terminate()
        assert process.wait(15) == 0
    finally:
        process.kill()
        process.communicate()
