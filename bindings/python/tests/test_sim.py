"""Benches: virtual time, the same results each time, loads, faults and scenarios."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motorlink
from motorlink import sim

SERVO = "[[st.motor]]\npreset = 'servo'"
SCENARIOS = Path(__file__).parents[3] / "scenarios"


def started(bench: sim.Bench, rpm: float = 1000) -> motorlink.st.Motor:
    """The bench's first ST motor at a speed."""
    motor = bench.st.motor(1)
    motor.set_ramp(rpm, 0.2)
    motor.start()
    bench.run(3.0)
    return motor


def test_time_advances_only_during_a_wait() -> None:
    bench = sim.Bench()
    assert bench.now == 0.0
    assert repr(bench) == "<motorlink.sim.Bench st1, st2, rmd1, rmd2, rmd3, rmd4 at 0 s>"
    bench.st.motor(1).status()
    assert bench.now == pytest.approx(8 * 87e-6)  # eight bytes at 115200 baud
    before = bench.now
    bench.rmd.set_torque4([0, 0, 0, 0])
    assert bench.now - before == pytest.approx(5 * 125e-6)  # a frame there, four back
    bench.run(0.25)
    assert bench.now == pytest.approx(before + 5 * 125e-6 + 0.25)
    bench.run(0)
    for seconds in (-1, float("nan"), 1e6):
        with pytest.raises(motorlink.InvalidValueError, match="0 to 86400 s"):
            bench.run(seconds)


def test_the_same_program_and_seed_give_the_same_run() -> None:
    def run(seed: int, fault: str) -> tuple[list[str], bytes, str]:
        bench = sim.Bench(SERVO, seed=seed, fault=fault)
        told = []
        with bench.recording(["st1.speed_rpm", "rmd2.iq_amps"], every=0.01) as recording:
            for n in range(40):
                try:
                    told.append(str(bench.st.motor(1).get("SPEED_MEAS")))
                    told.append(str(bench.rmd.motor(2).set_speed(90 + n)))
                except motorlink.MotorlinkError as error:
                    told.append(str(error))
                bench.run(0.02)
        return told, recording.data.tobytes(), bench.state_hash

    first = run(1, "drop=5e-3,seed=2")
    assert first == run(1, "drop=5e-3,seed=2")
    assert first[1] != run(2, "drop=5e-3,seed=2")[1]
    assert first[0] != run(1, "drop=5e-3,seed=3")[0]


def test_configurations_are_text_a_file_or_a_dict(tmp_path: Path) -> None:
    text = "[[st.motor]]\npreset = 'shinano'\n[[rmd.motor]]\nid = 7\n"
    file = tmp_path / "bench.toml"
    file.write_text(text)
    named = {"st": {"motor": [{"preset": "shinano"}]}, "rmd": {"motor": [{"id": 7}]}}
    hashes = set()
    for config in (text, file, str(file), named):
        bench = sim.Bench(config)
        assert bench.motors == ("st1", "rmd7")
        hashes.add(bench.state_hash)
    assert len(hashes) == 1
    with pytest.raises(motorlink.InvalidValueError, match="nowhere.toml"):
        sim.Bench(tmp_path / "nowhere.toml")
    file.write_text("[[rmd.motor]]\nid = 33")
    with pytest.raises(motorlink.InvalidValueError, match=r"bench\.toml: rmd\.motor 1: .*1 to 32"):
        sim.Bench(file)


def test_the_client_of_a_bench_has_the_profile_of_its_drive() -> None:
    assert sim.Bench().st.profile == "spec"
    bus = sim.Bench("profile = 'mcsdk-5.4'").st
    assert bus.profile == "mcsdk-5.4"
    bus.motor(2).set_torque_ramp(100, 0.1)


def test_commands_change_the_surroundings_of_a_motor() -> None:
    bench = sim.Bench(SERVO)
    motor = started(bench)
    free = bench.truth("st1")["iq_amps"]
    bench.brake("st1", 0.1)
    bench.push("rmd1", -0.2)
    bench.temperature("st1", 60)
    bench.supply("rmd3", 20)
    bench.lock_rotor("rmd2")
    bench.rmd.motor(2).set_torque(1)
    bench.run(1.0)
    assert bench.truth("st1")["iq_amps"] > 2 * free
    assert bench.truth("rmd1")["speed_dps"] < -100
    assert motor.get("HEATS_TEMP") == 60
    assert bench.rmd.motor(3).status().voltage_volts == pytest.approx(20, abs=0.5)
    assert abs(bench.truth("rmd2")["speed_dps"]) < 1
    bench.inject("st1", "BREAK_IN", hold=True)
    bench.temperature("st1", None)
    bench.lock_rotor("rmd2", False)
    bench.run(0.5)
    assert (motor.status(), motor.flags().present) == ("FAULT_NOW", ("BREAK_IN",))
    assert bench.truth("st1")["faults"] == "BREAK_IN"
    assert motor.get("HEATS_TEMP") < 60
    assert bench.truth("rmd2")["speed_dps"] > 100
    bench.inject("st1", "BREAK_IN", hold=False)
    bench.rmd.motor(1).write_pid_ram(bench.rmd.motor(1).pid()._replace(speed_kp=7))
    bench.power_cycle("rmd1")
    assert bench.rmd.motor(1).pid().speed_kp != 7
    bench.power_cycle("st")
    assert motor.flags().present == ()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda bench: bench.brake("st9", 1), "the motors are st1, st2, rmd1"),
        (lambda bench: bench.truth("st9"), "the motors are st1, st2, rmd1"),
        (lambda bench: bench.brake("st1", -1), "0 to 1000"),
        (lambda bench: bench.brake("st1", float("nan")), "not a command: .*nan"),
        (lambda bench: bench.execute({"command": object()}), "not a command: .*object"),
        (lambda bench: bench.inject("st1", "FIRE"), "BREAK_IN"),
        (lambda bench: bench.power_cycle("st1"), "one supply"),
        (lambda bench: bench.record(["st1.speed"], seconds=1), "st1.speed_rpm"),
        (lambda bench: bench.record(["st1.iq_amps"] * 2, seconds=1), "named twice"),
        (lambda bench: bench.record([], seconds=1), "name what"),
        (lambda bench: bench.port(fault="explode=1"), "explode"),
    ],
)
def test_invalid_calls_are_refused_and_change_nothing(wrong: Any, message: str) -> None:
    bench = sim.Bench()
    before = bench.state_hash
    with pytest.raises(motorlink.InvalidValueError, match=message):
        wrong(bench)
    assert (bench.now, bench.state_hash) == (0.0, before)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"config": "[[st.motor]]\npreset = 3"}, "st.motor 1: the presets are"),
        ({"config": "[[st.motor"}, "line 1, column 11"),
        ({"config": "missing.toml"}, "cannot read `missing.toml`: No such file"),
        ({"config": {"st": object()}}, "not a configuration: .*object is not JSON"),
        ({"seed": -1}, "a seed of -1: give 0 to 4294967295"),
        ({"fault": "explode=1"}, "explode"),
    ],
)
def test_a_bench_that_cannot_be_built_says_why(arguments: Any, message: str) -> None:
    with pytest.raises(motorlink.InvalidValueError, match=message):
        with sim.Bench(**arguments):
            pass


def test_a_bench_is_of_text_a_path_or_a_dict() -> None:
    with pytest.raises(TypeError, match="TOML text or the path of a file, not 5"):
        sim.Bench(5)  # type: ignore[arg-type]


def test_a_traceback_can_show_a_bench_that_was_not_built() -> None:
    """pytest prints `self` of each function in a traceback."""
    assert repr(sim.Bench.__new__(sim.Bench)) == "<motorlink.sim.Bench, not built>"


def test_truth_has_the_signals_with_their_units() -> None:
    bench = sim.Bench()
    truth = bench.truth("st1")
    names = [name for name in bench.signals if name.startswith("st1.")]
    assert [f"st1.{name}" for name in truth] == names
    assert bench.signals["st1.bus_volts"] == "V"
    assert bench.signals["st1.status"] == ""
    assert truth["status"] == "IDLE"
    assert truth["bus_volts"] == pytest.approx(325, abs=1)


def test_a_recording_can_be_read_before_its_end() -> None:
    bench = sim.Bench()
    bench.rmd.motor(1).set_speed(360)
    with bench.recording(["rmd1.angle_degrees", "rmd1.mode"], every=0.1) as recording:
        bench.run(0.25)
        assert len(recording.data) == 3
        bench.run(0.1)
        assert len(recording.data) == 4
    bench.run(1.0)
    data = recording.data
    assert data.dtype.names == ("t", "rmd1.angle_degrees", "rmd1.mode")
    np.testing.assert_allclose(data["t"], np.arange(4) * 0.1)
    assert set(data["rmd1.mode"]) == {3} and np.all(np.diff(data["rmd1.angle_degrees"]) > 0)
    data["rmd1.angle_degrees"][0] = 1.0  # its own memory


def test_registers_are_sampled_on_virtual_time() -> None:
    bench = sim.Bench(SERVO)
    started(bench)
    before = bench.now
    samples = bench.st.sample(["SPEED_MEAS", "TORQUE_MEAS"], rate=100, seconds=1)
    assert len(samples) == 100
    # The instant after the last one confirms the last rows.
    assert bench.now - before == pytest.approx(1, abs=0.03)
    np.testing.assert_allclose(np.diff(samples["t"]), 0.01, atol=1e-6)
    assert samples["SPEED_MEAS"].mean() == pytest.approx(1000, abs=20)


def test_an_instant_between_two_microseconds_is_reached() -> None:
    bench = sim.Bench()
    samples = bench.rmd.sample(["speed_dps"], rate=3, seconds=2)
    np.testing.assert_allclose(samples["t"], np.arange(6) / 3, atol=2e-6)


def test_the_end_of_a_bench_stops_its_motors() -> None:
    with sim.Bench(SERVO) as bench:
        started(bench)
        bench.rmd.motor(1).set_speed(360)
    bench.run(5.0)
    assert bench.truth("st1")["status"] == "IDLE"
    assert bench.truth("rmd1")["mode"] == "stopped"
    assert bench.st.motor(1).status() == "IDLE"  # another bus


def test_a_motor_that_cannot_be_stopped_does_not_hide_an_exception() -> None:
    with pytest.warns(RuntimeWarning, match="motor 1 may still be running"):
        with pytest.raises(ZeroDivisionError):
            with sim.Bench(SERVO, fault="drop=1,only=received") as bench:
                with pytest.raises(motorlink.ReplyTimeoutError):
                    bench.st.motor(1).start()
                with pytest.raises(motorlink.ReplyTimeoutError):
                    bench.rmd.motor(1).set_speed(90)
                raise ZeroDivisionError
    # All replies were lost. The motors received their requests.
    bench.run(5.0)
    assert bench.truth("st1")["status"] == "IDLE"
    assert bench.truth("rmd1")["mode"] == "stopped"


def test_time_sleep_advances_the_time_of_the_bench() -> None:
    bench = sim.Bench()
    elsewhere: list[float] = []

    def other() -> None:
        time.sleep(0.001)
        elsewhere.append(time.monotonic())

    real = time.sleep
    with bench.patch_time():
        began = [clock() for clock in (time.monotonic, time.perf_counter, time.time)]
        time.sleep(100)
        now = [clock() for clock in (time.monotonic, time.perf_counter, time.time)]
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        virtual = time.monotonic()
        assert time.monotonic_ns() == round(virtual * 1e9)
        with pytest.raises(ValueError):
            time.sleep(-1)
    assert time.sleep is real
    assert np.subtract(now, began) == pytest.approx([100, 100, 100])
    assert bench.now == pytest.approx(100)
    assert elsewhere[0] < virtual - 50


RUN = "bench.run(86400)"
SCENARIO = """motorlink.sim.run(
    "title = 'A day'; duration = 86400; sample_us = 10000000; [[rmd.motor]];"
    "[[event]]; at = 0; rmd = 1; send = 'speed'; speed_dps = 360".replace(";", "\\n")
    )"""


@pytest.mark.parametrize("long", [RUN, SCENARIO], ids=["run", "scenario"])
def test_ctrl_c_ends_long_calls(long: str) -> None:
    code = f"""
import motorlink
bench = motorlink.sim.Bench()
bench.st.motor(1).start()
try:
    print("runs", flush=True)
    {long}
    print("to the end")
except KeyboardInterrupt:
    print("interrupted", bench.now < 86400, bench.st.motor(1).status() != "")
"""
    program = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert program.stdout
    assert program.stdout.readline() == "runs\n"
    program.send_signal(signal.SIGINT)
    out, err = program.communicate(timeout=60)
    assert (out, err) == ("interrupted True True\n", "")


def test_other_threads_run_while_time_advances() -> None:
    bench = sim.Bench(SERVO)
    started(bench)
    over = threading.Event()
    turns = 0

    def count() -> None:
        nonlocal turns
        while not over.is_set():
            turns += 1

    thread = threading.Thread(target=count)
    thread.start()
    try:
        before = turns
        bench.run(20)
        assert turns > before + 1000
    finally:
        over.set()
        thread.join()


def test_an_object_that_is_not_a_port_is_refused() -> None:
    with pytest.raises(TypeError, match="3 is not a port: give a name"):
        motorlink.st.open(3)  # type: ignore[arg-type]


def test_one_of_the_scenarios_that_ship_runs_as_expected() -> None:
    path = SCENARIOS / "sensorless-start.toml"
    run = sim.run(path)
    assert run.as_expected, run.failures
    assert run.expectations and all(one.holds for one in run.expectations)
    assert set(run.units) == set(run.samples.dtype.names or ()) - {"t"}
    assert np.all(np.diff(run.samples["t"]) > 0)
    assert sim.run(str(path)).state_hash == run.state_hash


def test_failed_expectations_are_reported() -> None:
    run = sim.run(
        """
        title = "A refusal"
        duration = 0.2
        [[st.motor]]
        [[event]]
        at = 0.1
        st = 1
        send = "set"
        register = "SPEED_MEAS"
        value = 3
        label = "nonsense"
        [[expect]]
        why = "it turns"
        signal = "st1.speed_rpm"
        min = 1
        """
    )
    assert not run.as_expected
    (refusal,) = run.refusals
    assert (refusal.at, refusal.motor, refusal.reply) == (0.1, "st1", "SET_READ_ONLY")
    assert run.marks == [(0.1, "nonsense")]
    assert run.failures == [
        "it turns: st1.speed_rpm 0 rpm at 0 s, expected at least 1 rpm: off by 1 rpm",
        "at 0.1 s st1 refused `SPEED_MEAS 3` with SET_READ_ONLY",
    ]
    with pytest.raises(motorlink.InvalidValueError, match="nowhere"):
        sim.run("nowhere.toml")


def test_presets_have_every_value() -> None:
    presets = sim.presets()
    assert set(presets) == {"drone", "shinano", "servo", "mains", "rmd-l-5005", "rmd-x8"}
    assert presets["drone"]["machine"]["resistance"] == 0.11
