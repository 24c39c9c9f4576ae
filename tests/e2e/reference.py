"""A permanent-magnet synchronous motor on an ideal source, integrated by SciPy.

Written from the textbook's equations and the documented forms of friction, cogging and iron loss,
to hold the simulator against: electrical quantities in the rotor's frame, with d on the magnet and
amplitudes of phases; SI units, at the rotor.

    Ld did/dt = vd - R id + we Lq iq
    Lq diq/dt = vq - R iq - we (Ld id + psi)             we = p w
    T         = 1.5 p (psi iq + (Ld - Lq) id iq)
    J dw/dt   = T - Tcog sin(n theta) - (B + Be) w - dry(w) sign(w) - Tgear
    dry(w)    = Tc + (Ts - Tc) / (1 + (w/ws)^2) + Th

Behind a gear of the ratio N turns an inertia against a torque and a brake, all at the output:

    tau       = (Jout dw/dt / N + Tout + Tbrake sign(w)) / N
    Tgear     = tau / eta where the motor drives the load, eta' tau where the load drives the motor

A rotor at rest stays at rest while it is accelerated in neither direction. The motion is piecewise: a
rotor that comes to rest, and one that is pulled loose, are events at which integration stops and
goes on with the equations of the other piece.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

# Of a solution that others are compared with: four digits more than the comparison needs.
PRECISE = 1e-7


@dataclass(frozen=True)
class Motor:
    """What the simulator's `plant.machine` says of the rotor."""

    pole_pairs: int
    resistance: float
    inductance_d: float
    inductance_q: float
    flux_linkage: float
    inertia: float
    viscous_friction: float
    coulomb_friction: float
    stiction: float
    stribeck_speed: float
    cogging_torque: float
    cogging_periods: int
    iron_hysteresis: float
    iron_eddy: float

    def torque(self, d, q):
        saliency = (self.inductance_d - self.inductance_q) * d
        return 1.5 * self.pole_pairs * (self.flux_linkage + saliency) * q

    def pull(self, d, q, angle):
        """Torque that turns a rotor, before friction."""
        cogging = self.cogging_torque * math.sin(self.cogging_periods * angle)
        return self.torque(d, q) - cogging

    def dry(self, speed):
        fading = (self.stiction - self.coulomb_friction) / (1 + (speed / self.stribeck_speed) ** 2)
        return self.coulomb_friction + fading + self.iron_hysteresis


@dataclass(frozen=True)
class Output:
    """What the motor drives: `plant.machine.gear` and `plant.load`; nothing without a gear."""

    ratio: float = 1.0
    efficiency: float = 1.0
    back_efficiency: float = 1.0
    inertia: float = 0.0
    torque: float = 0.0
    brake: float = 0.0

    def acceleration(self, motor, torque, direction):
        """Of a rotor that turns in a direction, by a torque from which its own friction is gone."""
        opposing = (self.torque + self.brake * direction) / self.ratio
        inertia = self.inertia / self.ratio**2
        forwards = (torque - opposing / self.efficiency) / (motor.inertia + inertia / self.efficiency)
        if (inertia * forwards + opposing) * direction >= 0:
            return forwards
        back = self.back_efficiency
        return (torque - opposing * back) / (motor.inertia + inertia * back)


@dataclass(frozen=True)
class Experiment:
    """From rest in the currents; a voltage (d, q) in the rotor's frame holds from the beginning."""

    voltage: tuple
    speed: float = 0.0
    angle: float = 0.0
    locked: bool = False
    output: Output = Output()


def solve(motor, experiment, times, tolerance=PRECISE):
    """Id, Iq, speed and angle at `times`, an array of a row each, within a relative `tolerance`."""
    state = np.array([0.0, 0.0, experiment.speed, experiment.angle])
    rows = np.empty((4, len(times)))
    now, direction = times[0], math.copysign(1.0, experiment.speed) if experiment.speed else 0.0
    while True:
        if direction == 0.0:
            direction = _loose(motor, experiment, state)
        equations, end = _piece(motor, experiment, direction)
        end.terminal = True
        ahead = times >= now
        piece = solve_ivp(
            equations,
            (now, times[-1]),
            state,
            t_eval=times[ahead],
            events=end,
            method="DOP853",
            rtol=tolerance,
            atol=tolerance / 100,
        )
        assert piece.success, piece.message
        first = np.argmax(ahead)
        rows[:, first : first + len(piece.t)] = piece.y
        if piece.status == 0:
            return rows
        now, state = piece.t_events[0][0], piece.y_events[0][0].copy()
        # The rotor stops, or it has been pulled loose: with no speed in either case.
        state[2] = 0.0
        direction = 0.0


def _loose(motor, experiment, state):
    """Where a rotor at rest turns to: 1, -1, or 0 where it stays."""
    if experiment.locked:
        return 0.0
    # At the event it is on the point of moving but for the last digits.
    slack = 1e-9 * motor.dry(0.0) / motor.inertia
    starts = {way: _start(motor, experiment, state, way) for way in (1.0, -1.0)}
    way = max(starts, key=starts.get)
    return way if starts[way] > -slack else 0.0


def _start(motor, experiment, state, direction):
    """Acceleration in a direction of a rotor at rest, if it begins to turn there."""
    d, q, _, angle = state
    torque = motor.pull(d, q, angle) - motor.dry(0.0) * direction
    return direction * experiment.output.acceleration(motor, torque, direction)


def _piece(motor, experiment, direction):
    """The equations of a rotor that turns in a direction or rests (0), and what ends them."""
    vd, vq = experiment.voltage
    poles, resistance, flux = motor.pole_pairs, motor.resistance, motor.flux_linkage
    ld, lq = motor.inductance_d, motor.inductance_q
    viscous = motor.viscous_friction + motor.iron_eddy

    def equations(_, state):
        d, q, speed, angle = state.tolist()
        electrical = poles * speed
        change_d = (vd - resistance * d + electrical * lq * q) / ld
        change_q = (vq - resistance * q - electrical * (ld * d + flux)) / lq
        if direction == 0.0:
            return change_d, change_q, 0.0, 0.0
        friction = viscous * speed + motor.dry(speed) * direction
        torque = motor.pull(d, q, angle) - friction
        change_speed = experiment.output.acceleration(motor, torque, direction)
        return change_d, change_q, change_speed, speed

    if experiment.locked:
        return equations, lambda *_: 1.0
    if direction == 0.0:
        # What pulls reaches what holds.
        def end(_, state):
            return max(_start(motor, experiment, state, way) for way in (1.0, -1.0))

        end.direction = 1.0
    else:

        # One that has just begun to turn has no speed yet.
        def end(_, state):
            return state[2] + direction * 1e-9

        end.direction = -direction
    return equations, end
