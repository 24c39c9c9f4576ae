"""What a drive says over the wire is what its motor really does, within the digits that it has."""

import pytest

from program import eventually
from test_rmd_can import (
    MOVE_LIMITED,
    READ_ENCODER,
    SPEED,
    STATUS_1,
    STATUS_3,
    TORQUE,
    Host,
    null,
)

# An RMD actuator with a gear.

GEAR = 9
COUNT = 360 / 2**14
"""Degrees of an encoder count."""
AMPERE = 2048 / 33
"""Digits of feedback."""
SENSED = 0.1
"""A: the current sensors' digit of 20 mA, and five times their noise of 10 mA on two of them."""


@pytest.fixture
def rmd(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text('[[rmd.motor]]\npreset = "rmd-x8"\nacceleration_dps2 = 2000\n')
    return sim(config, st=())


@pytest.fixture
def host(rmd):
    with Host(rmd.can) as host:
        yield host


def mean(values):
    return sum(values) / len(values)


class Between:
    """What a motor did before and after something was read."""

    def __init__(self, simulator):
        self.simulator = simulator

    def __enter__(self):
        self.before = self.simulator.motor(1)
        return self

    def __exit__(self, *_):
        self.after = self.simulator.motor(1)

    def has(self, value, member, digit):
        """Whether a value that was read is from in between, for one that only grows."""
        return self.before[member] - digit <= value <= self.after[member] + digit


def test_a_move_is_read_as_it_happens(rmd, host):
    host.ask(1, MOVE_LIMITED, null("xHi", 900, 72000))
    seen = 0
    while host.multi_turn_angle(1) < 719.9:
        with Between(rmd) as truth:
            angle = host.multi_turn_angle(1)
        assert truth.has(angle, "angle_degrees", COUNT + 0.01), (truth.before, angle, truth.after)
        with Between(rmd) as truth:
            position, raw, _ = host.read(1, READ_ENCODER, "xHHH")
        turns = truth.before["angle_degrees"] // 360
        if turns == truth.after["angle_degrees"] // 360:
            assert truth.has(turns * 360 + raw * COUNT, "angle_degrees", COUNT)
        assert position == raw
        seen += 1
    assert seen > 10
    eventually(lambda: host.speed(1) == 0, "the move is over")
    assert abs(rmd.motor(1)["output_degrees"] - 720 / GEAR) < 0.05
    assert abs(host.multi_turn_angle(1) - rmd.motor(1)["angle_degrees"]) < COUNT + 0.01


def test_speed_and_current_are_read_as_they_are_with_and_without_a_load(rmd, host):
    host.ask(1, SPEED, null("3xi", 90_000))
    eventually(lambda: abs(host.speed(1) - 900) < 3, "900 °/s")

    def readings():
        motions = [host.motion(1) for _ in range(30)]
        truths = [rmd.motor(1) for _ in range(30)]
        speed = mean([speed for _, _, speed, _ in motions])
        current = mean([iq / AMPERE for _, iq, _, _ in motions])
        assert abs(speed - mean([truth["speed_dps"] for truth in truths])) < 3
        assert abs(current - mean([truth["iq_amps"] for truth in truths])) < SENSED / 2
        return speed, current

    _, idle = readings()
    rmd.do("load", motor=1, newton_metres=4.0)
    # 4 Nm over 9 and what the gear loses are 0.48 Nm, at 0.214 Nm/A.
    eventually(lambda: abs(rmd.motor(1)["iq_amps"] - idle - 2.26) < 0.3, "the load is carried")
    eventually(lambda: abs(host.speed(1) - 900) < 3, "900 °/s under load")
    speed, current = readings()
    assert abs(speed - 900) < 3 and abs(current - idle - 2.26) < 0.2


def test_phase_currents_voltage_and_temperature_are_read_as_they_are(rmd, host):
    rmd.do("lock-rotor", motor=1, locked=True)
    host.ask(1, TORQUE, null("3xhxx", round(8 * 2000 / 32)))
    eventually(lambda: abs(rmd.motor(1)["iq_amps"] - 8) < 0.1, "8 A")
    for _ in range(20):
        digits = host.read(1, STATUS_3, "xhhh")
        truth = rmd.motor(1)
        for phase, amps in zip(digits, truth["phase_amps"]):
            assert abs(phase / 64 - amps) < SENSED, (digits, truth)
        assert abs(truth["torque_newton_metres"] - 8 * 0.2142) < 0.02 * 8 * 0.2142
        with Between(rmd) as truth:
            celsius, volts, errors = host.read(1, STATUS_1, "bxHxxB")
        assert errors == 0
        assert truth.has(celsius, "celsius", 0.5)
        assert abs(volts / 10 - truth.after["supply_volts"]) < 0.06
