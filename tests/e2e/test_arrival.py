"""Moves with `--wait`: they end when the motor has arrived, and stop it otherwise.

When a motor has arrived, on good and on bad lines, is tested in crates/motorlink/tests/arrival.rs.
"""

import fcntl
import signal
import subprocess

import pytest

from program import environment, eventually

FAST = ["--max-speed", 720]
FAR = ["position", 72000, *FAST, "--wait"]


@pytest.fixture(name="bench")
def on_a_bus(sim):
    return sim(st=())


@pytest.fixture(name="rmd")
def on_its_port(run, bench):
    port = bench.port("slcan")
    return lambda *words: run("rmd", "-p", port, "--timeout", "500ms", *words)


@pytest.fixture
def waiting(start, bench):
    """A move that has begun."""
    waiting = start("rmd", "-p", bench.port("slcan"), "--timeout", "500ms", "--trace", *FAR)
    waiting.says("< 0xA4")
    return waiting


def angle(rmd):
    return rmd("--json", "angle").ended(0).values["multi_turn_angle"]


def is_still(rmd):
    return angle(rmd) == pytest.approx(angle(rmd), abs=0.05)


def test_a_move_returns_when_the_motor_is_there(rmd):
    done = rmd("--json", "position", -33.3, *FAST, "--wait").ended(0)
    assert done.values["multi_turn_angle"] == pytest.approx(-33.3, abs=0.1)
    assert angle(rmd) == pytest.approx(-33.3, abs=0.15)
    done = rmd("single-turn-position", 350, "cw", *FAST, "--wait").ended(0)
    title, _, arrived_at = done.out.splitlines()[0].rpartition("angle ")
    assert title == "multi turn " and float(arrived_at.split()[0]) == pytest.approx(-10, abs=0.1), done.out
    assert angle(rmd) == pytest.approx(-10, abs=0.15)
    assert is_still(rmd)


def test_a_signal_stops_the_motor(waiting, rmd):
    for _ in range(2):
        waiting.process.send_signal(signal.SIGTERM)
    assert waiting.wait() == 130
    waiting.says("motor 1 was stopped")
    assert angle(rmd) < 70_000
    assert is_still(rmd)


def test_messages_that_are_not_read_keep_no_motor_from_its_stop(motorlink, bench, rmd):
    words = ["rmd", "-p", bench.port("slcan"), "--timeout", "500ms", "--trace", *map(str, FAR)]
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen([motorlink, *words], **pipes, env=environment()) as waiting:
        fcntl.fcntl(waiting.stderr, fcntl.F_SETPIPE_SZ, 4096)
        eventually(lambda: abs(bench.motor(1)["angle_degrees"]) > 720, "two turns")
        waiting.send_signal(signal.SIGINT)
        assert waiting.wait(15) == 130
    assert is_still(rmd)


def test_a_motor_that_needs_longer_is_stopped(rmd):
    done = rmd(*FAR, "--wait-timeout", "500ms").ended(1)
    assert "the time is over and the motor is moving" in done.err
    assert "° from its target; motor 1 was stopped and holds still; try a longer" in done.err
    assert is_still(rmd)


def test_an_error_of_the_motor_ends_the_wait(waiting, bench):
    bench.do("fault", motor=1, fault="LOW_VOLTAGE")
    assert waiting.wait() == 1
    waiting.says("the motor reports low voltage protection")
    assert not any("holds still" in line for line in waiting.err)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_drives_that_are_killed_or_frozen_end_the_wait(waiting, bench, number):
    bench.process.send_signal(number)
    assert waiting.wait() == 3
    waiting.says("may still be turning")
    bench.process.send_signal(signal.SIGCONT)


def test_an_st_move_needs_a_motor_that_runs_and_a_signal_stops_it(run, start, sim, tmp_path):
    config = tmp_path / "servo.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n')
    words = ("st", "-p", sim(config, rmd=()).port("pty"), "--profile", "mcsdk-5.4")
    value = lambda name: run(*words, "--json", "get", name).ended(0).values[name]
    refused = run(*words, "--trace", "position", "3rad", "0.5s", "--wait").ended(1)
    assert "the motor is in IDLE, not in RUN; the move was not sent; start the motor first" in refused.err
    assert "SET_POSITION_CMD" not in refused.err
    run(*words, "start").ended(0)
    run(*words, "position", "3rad", "0.5s", "--wait").ended(0)
    assert value("CURRENT_POSITION") == pytest.approx(3, abs=0.01)
    waiting = start(*words, "--trace", "position", "300rad", "60s", "--wait")
    waiting.says("CURRENT_POSITION")
    waiting.interrupt()
    assert waiting.wait() == 130
    eventually(lambda: value("STATUS") == 0, "IDLE")
