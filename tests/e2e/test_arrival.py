"""Moves with `--wait`: they end when the motor has arrived, and stop it otherwise."""

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


def angle(rmd):
    return rmd("--json", "angle").ended(0).values["multi_turn_angle"]


def is_still(rmd):
    return angle(rmd) == pytest.approx(angle(rmd), abs=0.05)


@pytest.mark.parametrize("degrees", [90, -33.3, 0.3])
def test_a_move_returns_when_the_motor_is_there(rmd, degrees):
    done = rmd("--json", "position", degrees, *FAST, "--wait").ended(0)
    assert done.values["multi_turn_angle"] == pytest.approx(degrees, abs=0.1)
    assert angle(rmd) == pytest.approx(degrees, abs=0.15)
    assert is_still(rmd)


def test_a_move_within_the_turn_returns_when_the_motor_is_there(rmd):
    done = rmd("single-turn-position", 350, "ccw", *FAST, "--wait").ended(0)
    title, _, arrived_at = done.out.splitlines()[0].rpartition("angle ")
    assert title == "multi turn " and float(arrived_at.split()[0]) == pytest.approx(-10, abs=0.1), done.out
    assert angle(rmd) == pytest.approx(-10, abs=0.15)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_the_motor(start, bench, rmd, number):
    waiting = start("rmd", "-p", bench.port("slcan"), "--timeout", "500ms", "--trace", *FAR)
    waiting.says("< 0xA4")
    for _ in range(2):
        waiting.process.send_signal(number)
    assert waiting.wait() == 130
    waiting.says("motor 1 was stopped")
    assert angle(rmd) < 70_000
    assert is_still(rmd)


def test_messages_that_are_not_read_keep_no_motor_from_its_stop(motorlink, bench, rmd):
    words = ["rmd", "-p", bench.port("slcan"), "--trace", *map(str, FAR)]
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


def test_a_motor_that_is_held_is_stopped(bench, rmd):
    bench.do("lock-rotor", motor=1, locked=True)
    done = rmd("position", 90, *FAST, "--wait").ended(1)
    assert "the motor stopped before its target, 90.00° from its target" in done.err


def test_a_full_turn_that_begins_slowly_is_waited_for(rmd):
    rmd("position", 0.1, "--wait", "--wait-tolerance", 0.03).ended(0)
    rmd("acceleration", 50).ended(0)
    before = angle(rmd)
    rmd("single-turn-position", 0, "cw", "--full-turn", *FAST, "--wait").ended(0)
    assert angle(rmd) - before > 359


def test_a_motor_that_loses_its_supply_on_its_way_has_not_arrived(start, bench, rmd):
    rmd("position", 720, *FAST, "--wait").ended(0)
    slow = ("--trace", "position", 0, "--max-speed", 10, "--wait")
    waiting = start("rmd", "-p", bench.port("slcan"), "--timeout", "500ms", *slow)
    waiting.says("< 0xA4")
    bench.do("power-cycle", motor=1)
    assert waiting.wait() == 1
    waiting.says("lost its counted turns")


def test_an_error_of_the_motor_ends_the_wait(start, bench):
    waiting = start("rmd", "-p", bench.port("slcan"), "--timeout", "500ms", "--trace", *FAR)
    waiting.says("< 0xA4")
    bench.do("fault", motor=1, fault="LOW_VOLTAGE")
    assert waiting.wait() == 1
    waiting.says("the motor reports low voltage protection")
    assert not any("holds still" in line for line in waiting.err)


def test_drives_that_are_killed_end_the_wait(start, bench):
    waiting = start("rmd", "-p", bench.port("slcan"), "--timeout", "500ms", "--trace", *FAR)
    waiting.says("< 0xA4")
    bench.kill()
    assert waiting.wait() == 3
    waiting.says("may still be turning")


def test_frozen_drives_end_the_wait(start, bench):
    waiting = start("rmd", "-p", bench.port("slcan"), "--timeout", "500ms", "--trace", *FAR)
    waiting.says("< 0xA4")
    bench.process.send_signal(signal.SIGSTOP)
    assert waiting.wait() == 3
    waiting.says("may still be turning")
    bench.process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("fault", ["drop=0.02", "dup=0.05", "delay=5ms..30ms", "flip=1e-4"])
def test_a_bad_line_makes_no_false_arrival(rmd, fault):
    done = rmd("--fault", f"{fault},seed=2", "position", 360, *FAST, "--wait")
    if done.code == 0:
        assert angle(rmd) == pytest.approx(360, abs=0.15)
    assert is_still(rmd)


def test_waits_take_no_negative_tolerance_and_need_wait(rmd):
    assert "0 or more" in rmd(*FAR, "--wait-tolerance=-1").ended(2).err
    assert "--wait" in rmd("position", 90, "--wait-timeout", "1s").ended(2).err


@pytest.fixture(name="servo")
def on_a_line(run, sim, tmp_path):
    config = tmp_path / "servo.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n')
    port = sim(config, rmd=()).port("pty")
    words = ("st", "-p", port, "--profile", "mcsdk-5.4")
    return words, lambda *more: run(*words, *more)


def test_an_st_move_returns_when_the_motor_is_there(servo):
    _, st = servo
    st("start").ended(0)
    st("position", "3rad", "0.5s", "--wait").ended(0)
    position = st("--json", "get", "CURRENT_POSITION").ended(0).values["CURRENT_POSITION"]
    assert position == pytest.approx(3, abs=0.01)


def test_an_st_motor_that_is_not_running_is_sent_no_move(servo):
    _, st = servo
    done = st("--trace", "position", "3rad", "0.5s", "--wait").ended(1)
    assert "the motor is in IDLE, not in RUN; the move was not sent; start the motor first" in done.err
    assert "SET_POSITION_CMD" not in done.err


def test_a_signal_stops_an_st_motor(servo, start):
    words, st = servo
    st("start").ended(0)
    waiting = start(*words, "--trace", "position", "300rad", "60s", "--wait")
    waiting.says("CURRENT_POSITION")
    waiting.interrupt()
    assert waiting.wait() == 130
    state = lambda: st("--json", "get", "STATUS").ended(0).values["STATUS"]
    eventually(lambda: state() == 0, "IDLE")
