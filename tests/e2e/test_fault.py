"""`--fault`: a line with chosen faults, on real and on simulated ports; writes that are verified.

What each fault does is tested in crates/link/src/fault.
"""

import json
import time
from itertools import pairwise

import pytest

from program import plain

ST = ("st", "-p", "sim:")
RMD = ("rmd", "-p", "sim:")


def test_what_is_late_still_comes(run, drives):
    began = time.monotonic()
    late = run("st", "-p", drives.port("pty"), "--fault", "delay=60ms", "get", "STATUS").ended(0)
    assert time.monotonic() - began >= 0.12, "both ways"
    assert "STATUS" in late.out
    late = run("rmd", "-p", drives.port("slcan"), "--timeout", "2s", "--fault", "delay=10ms", "angle").ended(0)
    assert "angle" in late.out


def test_damage_is_found_and_shown(run):
    damaged = run(*ST, "--fault", "flip=1e-1,only=received,seed=2", "--trace", "info").ended(3)
    assert "06 00 06" in damaged.err, "what the program sent"
    assert "f0 20 05 04 04 53" not in damaged.err, "what it received"


def test_a_watch_goes_on_through_damage(run):
    fault = "drop=1e-2,seed=3"
    watch = run(
        *ST, "--json", "--timeout", "30ms", "--fault", fault, "get", "BUS_VOLTAGE", "--every", "2ms",
        "--count", 40,
    ).ended(0)
    assert {plain(line)["BUS_VOLTAGE"] for line in watch.lines if "values" in line} == {325}
    events = [line["event"] for line in watch.lines if "event" in line]
    assert events and events == ["outage", "back"] * (len(events) // 2)


@pytest.mark.parametrize(
    "arguments, why",
    [
        ((*ST, "--fault", "flop=1", "info"), "there is no fault `flop`"),
        ((*ST, "--fault", "corrupt=1e-3", "info"), "use flip"),
        ((*RMD, "--fault", "stuck0=1s@1", "status"), "use cut"),
        (("st", "-p", "/dev/ttyNONE", "--fault", "drop=1", "scan"), "cannot be used with --fault"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_sent(run, arguments, why):
    assert why in run(*arguments).ended(2).err


def test_a_verified_write_reads_back_and_is_repeated_where_the_line_loses_it(run):
    done = run(*ST, "--json", "--trace", "set", "SPEED_KP", 790, "--verify").ended(0)
    assert (done.json["ok"], done.json["attempts"]) == (True, 1)
    sent = [line for line in done.err.splitlines() if "->" in line]
    assert sum("SPEED_KP" in line for line in sent) == 3, "a read, a write and a read"
    fault = ("--timeout", "50ms", "--fault", "drop=5e-2,seed=2")
    done = run(*ST, *fault, "--json", "set", "SPEED_KP", 700, "--verify=9").ended(0)
    assert done.json["attempts"] > 1
    lost = run(*ST, "--timeout", "50ms", "--fault", "drop=1", "set", "SPEED_KP", 700, "--verify=2")
    assert "failed" in lost.ended(3).err


def test_a_drive_that_acknowledges_and_ignores_is_found_out(run, tmp_path):
    config = tmp_path / "mcsdk.toml"
    config.write_text('profile = "mcsdk-5.4"\n')
    st = ("st", "-p", f"sim:{config}", "--profile", "mcsdk-5.4", "--raw")
    assert "DAC_OUT1 should be 5 and reads" in run(*st, "set", "DAC_OUT1", 5, "--verify").ended(1).err
    # What acts on the motor is not verified.
    refused = run(*ST, "--trace", "set", "RAMP_FINAL_SPEED", 1, "--verify").ended(2)
    assert "cannot be verified" in refused.err and "->" not in refused.err


def test_a_line_that_is_too_slow_is_said_and_again_if_that_changes(run):
    slow = ("--fault", "delay=20ms")
    table = run(*ST, *slow, "--timeout", "5s", "get", "SPEED_MEAS", "--every", "10ms", "--count", 40).ended(0)
    notes = [line for line in table.err.splitlines() if line]
    assert notes and all(line.startswith("asked 100 Hz; this line carries about ") for line in notes)
    rates = [float(line.split()[-2]) for line in notes]
    assert all(rate < 25 for rate in rates), "an exchange takes 40 ms"
    assert all(max(a, b) / min(a, b) > 1.4 for a, b in pairwise(rates)), "nothing is said twice"
    times = [float(line.split()[0]) for line in table.out.splitlines()[2:]]
    assert times == sorted(times) and len(times) == 40 and times[-1] >= 39 * 0.04
    notes = run(*RMD, *slow, "--json", "angle", "--every", "5ms", "--count", 20).ended(0).err
    assert json.loads(notes.splitlines()[0])["note"].startswith("asked 200 Hz; this line carries about ")
