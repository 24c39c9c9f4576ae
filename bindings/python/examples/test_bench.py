"""A test bench with pytest: it tests a robot's code against simulated drives in milliseconds.

    pytest test_bench.py

The package has the fixtures. `motorlink_bench` is a new bench on virtual time for each test. The marker
has its configuration. `motorlink_time` makes `time.sleep` advance the time of the bench.
"""

# %% The code under test
# It has no part of the simulation. It opens a port, sleeps, and reads the clock.
import time

import pytest

import motorlink


class Jammed(Exception):
    """The conveyor does not reach its speed."""


class Conveyor:
    """A conveyor belt on motor 1 of an ST drive."""

    def __init__(self, port):
        self._client = motorlink.st.open(port, speed_limit_rpm=3000)
        self._motor = self._client.motor(1)

    def run(self, rpm, patience=3.0):
        """Brings the belt to a speed. If it does not reach it, stops it and raises Jammed."""
        self._motor.set_ramp(rpm, 0.5)
        self._motor.start()
        deadline = time.monotonic() + patience
        while abs(self._motor.get("SPEED_MEAS") - rpm) > 0.05 * rpm:
            if time.monotonic() > deadline:
                self.stop()
                raise Jammed(f"{self._motor.get('SPEED_MEAS')} rpm instead of {rpm}")
            time.sleep(0.02)

    def recover(self):
        """Acknowledges the faults of the drive. Returns their names."""
        names = self._motor.flags().occurred
        self._motor.fault_ack()
        return names

    def stop(self):
        """Stops the belt."""
        self._motor.stop()


# %% The bench
# A flywheel replaces the belt. docs/SIMULATOR.md describes the configuration.
pytestmark = [
    pytest.mark.motorlink("[[st.motor]]\npreset = 'servo'\nplant.load.inertia = 2e-5"),
    pytest.mark.usefixtures("motorlink_time"),
]


@pytest.fixture
def conveyor(motorlink_bench):
    """A conveyor on the bench of the test."""
    return Conveyor(motorlink_bench)


# %% Normal operation
def test_it_reaches_its_speed(conveyor, motorlink_bench):
    conveyor.run(1500)
    motorlink_bench.run(1.0)
    assert motorlink_bench.truth("st1")["speed_rpm"] == pytest.approx(1500, rel=0.02)


def test_it_holds_its_speed_under_a_load(conveyor, motorlink_bench):
    conveyor.run(1500)
    motorlink_bench.brake("st1", 0.05)
    data = motorlink_bench.record(["st1.speed_rpm"], seconds=1.0)
    speed = data["st1.speed_rpm"]
    assert speed.min() > 1000
    assert speed[data["t"] > 0.5] == pytest.approx(1500, rel=0.03)


# %% Faults
def test_it_detects_a_jam_and_switches_the_current_off(conveyor, motorlink_bench):
    motorlink_bench.lock_rotor("st1")
    with pytest.raises(Jammed):
        conveyor.run(1500)
    motorlink_bench.run(0.5)
    truth = motorlink_bench.truth("st1")
    assert truth["faults"] == "SPEED_FDBK"  # the drive detects it too
    assert abs(truth["iq_amps"]) < 0.01


def test_it_recovers_after_a_fault(conveyor, motorlink_bench):
    conveyor.run(1000)
    motorlink_bench.inject("st1", "OVER_TEMP")
    motorlink_bench.run(5.0)
    assert conveyor.recover() == ("OVER_TEMP",)
    conveyor.run(1000)


def test_a_speed_over_the_limit_is_refused(conveyor, motorlink_bench):
    with pytest.raises(motorlink.InvalidValueError, match="3000 rpm"):
        conveyor.run(3500)
    assert motorlink_bench.truth("st1")["status"] == "IDLE"


def test_it_stops_on_a_bad_line(motorlink_bench):
    conveyor = Conveyor(motorlink_bench.port(fault="drop=5e-3,seed=5"))
    failures = 0

    def insist(action):
        nonlocal failures
        for _ in range(10):
            try:
                return action()
            except (motorlink.LinkError, motorlink.ReplyTimeoutError):
                failures += 1
        pytest.fail("all attempts failed")

    for rpm in range(500, 1500, 100):
        insist(lambda: conveyor.run(rpm))
    insist(conveyor.stop)
    assert failures > 0
    motorlink_bench.run(3.0)
    assert motorlink_bench.truth("st1")["status"] == "IDLE"
