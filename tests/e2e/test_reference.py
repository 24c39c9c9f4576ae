"""The simulated motors against SciPy's solution of their equations (reference.py).

A voltage step on a locked rotor, starts without load, a short circuit at speed, and loads behind a
gear that drive and are driven: half a second, in which currents, speed and angle agree at every sample within 0.2 % of their greatest value.
"""

import functools
import io
import json
import math
import subprocess
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from reference import Experiment, Motor, Output, solve

PRESETS = ["drone", "shinano", "mains", "rmd-l-5005", "rmd-x8"]
# Those with the same machine as another.
SAME = {"servo": "shinano"}
# No preset has a saliency: this is one of them with another Lq, H.
SALIENT = {"shinano, salient": ("shinano", 1.8e-3)}
MOTORS = [*PRESETS, *SALIENT]
TOLERANCE = 0.002
SIGNALS = ["id", "iq", "speed", "angle"]


@pytest.fixture(scope="module")
def plants(run):
    """What the program says of its presets, and what has a saliency."""
    lines = run("sim", "presets", "--json").ended(0).lines
    plants = {line["preset"]: line["plant"] for line in lines}
    for name, (preset, inductance_q) in SALIENT.items():
        machine = {**plants[preset]["machine"], "inductance_q": inductance_q}
        plants[name] = {**plants[preset], "machine": machine}
    return plants


def motor_of(plant):
    return Motor(**{field.name: plant["machine"][field.name] for field in fields(Motor)})


def experiments(plant):
    """From the motor's own values, so that the steps are great for it but nothing bursts."""
    motor = motor_of(plant)
    # The most that an inverter can make of the supply, and the speed whose back-EMF that is.
    volts = plant["supply"]["voltage"] / math.sqrt(3)
    speed = volts / (motor.pole_pairs * motor.flux_linkage)
    holding = motor.dry(0.0) + motor.cogging_torque
    breaking_loose = motor.resistance * holding / motor.torque(0.0, 1.0)
    return {
        "locked rotor": Experiment((0.1 * volts, 0.1 * volts), angle=0.25, locked=True),
        "start that hardly breaks loose": Experiment((0.0, 1.5 * breaking_loose)),
        "short circuit": Experiment((0.0, 0.0), speed=speed),
        "start": Experiment((0.0, volts), angle=0.25),
    }


# Of an RMD-X8 with loads that it drives and that drive it; torques are greater than its friction.
LOSSY = Output(ratio=9.0, efficiency=0.6, back_efficiency=0.4, inertia=0.1)
GEARED = {
    "flywheel": Experiment((0.0, 10.0), output=LOSSY),
    "flywheel backwards, against a torque and a brake": Experiment(
        (0.0, -10.0), output=replace(LOSSY, torque=-2.0, brake=1.0)
    ),
    "flywheel that is braked": Experiment((0.0, 0.0), speed=100.0, output=LOSSY),
    "lift": Experiment((0.0, 0.5), output=replace(LOSSY, torque=2.0)),
    "lift that is too heavy": Experiment((0.0, 0.5), output=replace(LOSSY, torque=16.0)),
    "lift that is held": Experiment((0.0, 0.1), output=replace(LOSSY, torque=2.0, brake=1.5)),
    "throw that comes down again": Experiment(
        (0.0, 0.0), speed=60.0, output=replace(LOSSY, torque=6.0, brake=0.5)
    ),
    "gear that says nothing of the way back": Experiment(
        (0.0, 0.0), output=replace(LOSSY, efficiency=0.8, back_efficiency=2 - 1 / 0.8, torque=6.0)
    ),
}

QUICK = ["locked rotor", "start that hardly breaks loose", "short circuit"]
# SciPy takes seconds for a start: two motors do that.
EXPERIMENTS = [(motor, name) for motor in MOTORS for name in QUICK]
EXPERIMENTS += [(motor, "start") for motor in ("rmd-l-5005", *SALIENT)]


@pytest.fixture(scope="module")
def simulate(motorlink, plants):
    """Rows of time, Id, Iq, speed and angle, by motor and experiment; each is run once."""
    machine = Path(motorlink).parent / "examples/machine"
    if not machine.exists():
        pytest.fail(f"{machine} is not built: `cargo build -p motorlink-sim --all-features --example machine`")

    @functools.cache
    def simulate(motor, name):
        known = GEARED if name in GEARED else experiments(plants[motor])
        done = subprocess.run(
            [machine],
            input=json.dumps(in_words(plants[motor]["machine"], known[name])),
            stdout=subprocess.PIPE,
            check=True,
            text=True,
            timeout=60,
        )
        return np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1).T

    return simulate


def in_words(machine, experiment):
    """What crates/sim/examples/machine.rs reads."""
    output = experiment.output
    load = {}
    if output != Output():
        gear = {"ratio": output.ratio, "efficiency": output.efficiency}
        # Said only where the simulator has no other.
        if not math.isclose(output.back_efficiency, 2 - 1 / output.efficiency):
            gear["back_efficiency"] = output.back_efficiency
        machine = {**machine, "gear": gear}
        load = {"inertia": output.inertia, "torque": output.torque, "brake": output.brake}
    return {
        "machine": machine,
        "load": load,
        "voltage": experiment.voltage,
        "speed": experiment.speed,
        "angle": experiment.angle,
        "locked": experiment.locked,
        "steps": 10_000,
    }


def deviations(rows, solution):
    """The greatest deviation of currents, speed and angle, as a share of each one's full scale."""
    full = np.abs(solution).max(axis=1)
    # A current is a share of the whole current: what Id ought to be may be nothing.
    full[:2] = np.hypot(*solution[:2]).max()
    return np.abs(rows - solution).max(axis=1) / np.where(full > 0, full, 1)


@pytest.mark.parametrize("motor, name", EXPERIMENTS)
def test_the_simulator_agrees_with_scipy(simulate, plants, motor, name):
    times, *rows = simulate(motor, name)
    assert len(times) == 10_001 and times[-1] == 0.5
    plant = plants[motor]
    solution = solve(motor_of(plant), experiments(plant)[name], times)
    found = dict(zip(SIGNALS, deviations(np.array(rows), solution).tolist()))
    assert max(found.values()) < TOLERANCE, found


@pytest.mark.parametrize("name", GEARED)
def test_a_gear_agrees_with_scipy(simulate, plants, name):
    times, *rows = simulate("rmd-x8", name)
    solution = solve(motor_of(plants["rmd-x8"]), GEARED[name], times)
    found = dict(zip(SIGNALS, deviations(np.array(rows), solution).tolist()))
    assert max(found.values()) < TOLERANCE, found


def test_every_preset_is_compared(plants):
    assert set(plants) == {*MOTORS, *SAME}
    assert all(plants[one]["machine"] == plants[other]["machine"] for one, other in SAME.items())


# Enough to see a deviation of TOLERANCE.
ROUGH = 1e-5
# A thousandth of what acts on these motors: one percent of it is nothing that could be noticed.
FAINT = {"viscous_friction", "iron_eddy"}


@pytest.mark.parametrize("parameter", [field.name for field in fields(Motor)])
def test_a_parameter_that_is_one_percent_off_is_noticed(simulate, plants, parameter):
    """The control: against a reference that is wrong in one parameter the comparison fails."""
    plant = plants["rmd-l-5005"]
    right = motor_of(plant)
    value = getattr(right, parameter)
    if isinstance(value, int):
        wrong = value + 1
    else:
        wrong = value * (2.0 if parameter in FAINT else 1.01)
    motor = replace(right, **{parameter: wrong})

    def deviation(name, experiment):
        times, *rows = simulate("rmd-l-5005", name)
        return deviations(np.array(rows), solve(motor, experiment, times, ROUGH)).max()

    # The first experiment that shows it ends the search.
    assert any(deviation(*each) > TOLERANCE for each in experiments(plant).items())
