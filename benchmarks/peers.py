"""Steps per second of other simulators, measured for `make bench` beside ours.

$ echo "gem plant 2000" | python benchmarks/peers.py '{"pole_pairs": 2, ...}'

The argument is the machine, in SI units, and its operating point (see `Machine`). The first line of
output lists the packages; then each line of input, a model's name and a number of steps, is answered with a
line of JSON: steps, the processor time they took, and the speed at which the rotor turns after them.

Each model is what is fastest of the package's own: no plots, no rewards that cost anything, no
switching within a period. What is ours instead of the package's is said where it is.
"""

import cmath
import importlib.metadata
import json
import math
import sys
import time
import types
import warnings

warnings.filterwarnings("ignore")

import gym_electric_motor as gem  # noqa: E402
import motulator.common.model._simulation as motulator_simulation  # noqa: E402
import motulator.drive.control.sm as motulator_control  # noqa: E402
from gym_electric_motor import physical_systems  # noqa: E402
from gym_electric_motor.reference_generators import (  # noqa: E402
    ConstReferenceGenerator,
    MultipleReferenceGenerator,
)
from motulator.drive import model as motulator_model  # noqa: E402
from motulator.drive.utils import SynchronousMachinePars  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402

PERIOD = 50e-6


class Machine:
    """A machine that turns steadily: its viscous load takes the whole torque at this speed."""

    def __init__(self, values):
        self.pole_pairs = values["pole_pairs"]
        self.resistance = values["resistance_ohm"]
        self.ld = values["ld_henry"]
        self.lq = values["lq_henry"]
        self.flux = values["flux_weber"]
        self.inertia = values["inertia_kg_m2"]
        self.bus = values["bus_volts"]
        self.speed = values["speed_rad_s"]
        self.iq = values["iq_amps"]
        self.torque = 1.5 * self.pole_pairs * self.flux * self.iq
        self.viscous = self.torque / self.speed
        electrical = self.pole_pairs * self.speed
        self.vd = -electrical * self.lq * self.iq
        self.vq = self.resistance * self.iq + electrical * self.flux


class Regulator:
    """Our PI regulators of d and q in plain floats, the least that Python can do for a control."""

    def __init__(self, machine, bandwidth=2 * math.pi * 500):
        self.gains = (bandwidth * machine.ld, bandwidth * machine.lq)
        self.integral_gain = bandwidth * machine.resistance * PERIOD
        self.d = 0.0
        self.q = machine.vq

    def voltage(self, error_d, error_q):
        self.d += self.integral_gain * error_d
        self.q += self.integral_gain * error_q
        return self.gains[0] * error_d + self.d, self.gains[1] * error_q + self.q


class Gem:
    """gym-electric-motor: Cont-CC-PMSM-v0 with its default solver, one Euler step a period."""

    package = "gym-electric-motor"

    def __init__(self, machine):
        self.machine = machine
        currents, speed = 4 * machine.iq, 4 * machine.speed
        limits = {"omega": speed, "torque": 4 * machine.torque, "i": currents, "u": machine.bus}
        self.environment = gem.make(
            "Cont-CC-PMSM-v0",
            supply={"u_nominal": machine.bus},
            motor={
                "motor_parameter": {
                    "p": machine.pole_pairs,
                    "r_s": machine.resistance,
                    "l_d": machine.ld,
                    "l_q": machine.lq,
                    "psi_p": machine.flux,
                    "j_rotor": machine.inertia / 2,
                },
                "limit_values": limits,
                "nominal_values": limits,
            },
            load=physical_systems.PolynomialStaticLoad(
                load_parameter={"a": 0, "b": machine.viscous, "c": 0, "j_load": machine.inertia / 2},
                load_initializer={"states": {"omega": machine.speed}},
            ),
            ode_solver=physical_systems.EulerSolver(),
            reference_generator=MultipleReferenceGenerator(
                sub_generators=(
                    ConstReferenceGenerator("i_sd", 0.0),
                    ConstReferenceGenerator("i_sq", machine.iq / currents),
                )
            ),
            tau=PERIOD,
            constraints=(),
            visualization=(),
        ).unwrapped  # gymnasium's own checks around each step are left away
        (self.state, self.reference), _ = self.environment.reset(seed=1)
        names = self.environment.state_names
        self.limits = self.environment.limits
        self.omega, self.d, self.q, self.angle = map(
            names.index, ("omega", "i_sd", "i_sq", "epsilon")
        )

    def duties(self, vd, vq):
        """The three duties in -1..1 that make this voltage, through gym-electric-motor's angle."""
        electrical = self.state[self.angle] * math.pi
        cosine, sine = math.cos(electrical), math.sin(electrical)
        scale = 2 / self.machine.bus
        alpha, beta = scale * (cosine * vd - sine * vq), scale * (sine * vd + cosine * vq)
        beta *= math.sqrt(3) / 2
        return alpha, beta - alpha / 2, -beta - alpha / 2

    def speed(self):
        return self.state[self.omega] * self.limits[self.omega]


class GemPlant(Gem):
    """`simulate` of the physical system alone, with voltages that turn with the rotor."""

    def run(self, steps):
        simulate = self.environment.physical_system.simulate
        for _ in range(steps):
            self.state = simulate(self.duties(self.machine.vd, self.machine.vq))


class GemControl(Gem):
    """`step` with the regulators above: its own controllers need a package that draws diagrams."""

    def __init__(self, machine):
        super().__init__(machine)
        self.regulator = Regulator(machine)

    def run(self, steps):
        step, regulator, d, q = self.environment.step, self.regulator, self.d, self.q
        scale = self.limits[q]
        for _ in range(steps):
            wanted_d, wanted_q = self.reference
            state = self.state
            voltage = regulator.voltage(
                scale * (wanted_d - state[d]), scale * (wanted_q - state[q])
            )
            (self.state, self.reference), _, _, _, _ = step(self.duties(*voltage))


def runge_kutta(rhs, span, state, max_step):
    """SciPy's RK23: faster here than motulator's default, and its LSODA takes no complex states."""
    return solve_ivp(rhs, span, state, method="RK23", max_step=max_step)


def midpoint(rhs, span, state, max_step):
    """One midpoint step in place of motulator's solver, for what is left when that costs little.

    A step of Euler's would not do: motulator's rotating states grow in it until they overflow.
    """
    step = span[1] - span[0]
    middle = [value + step / 2 * slope for value, slope in zip(state, rhs(span[0], state))]
    slopes = rhs(span[0] + step / 2, middle)
    after = [value + step * slope for value, slope in zip(state, slopes)]
    rhs.__self__.set_states(after)  # a solver's last evaluation leaves them so
    return types.SimpleNamespace(t=span, y=list(zip(state, after)))


class OpenLoop:
    """Replaces motulator's control: voltages in the rotor's frame, without a history."""

    def __init__(self, machine):
        self.duty = complex(machine.vd, machine.vq) / machine.bus
        self.pole_pairs = machine.pole_pairs

    def __call__(self, model):
        duty = self.duty * cmath.exp(1j * self.pole_pairs * model.mechanics.meas_position())
        beta = duty.imag * math.sqrt(3) / 2
        return PERIOD, (duty.real, beta - duty.real / 2, -beta - duty.real / 2)

    def post_process(self):
        pass


class Motulator:
    """motulator: Drive with StiffMechanicalSystem, duties held for a period, delay of one sample."""

    package = "motulator"

    def __init__(self, machine, control, solver):
        parameters = SynchronousMachinePars(
            n_p=machine.pole_pairs,
            R_s=machine.resistance,
            L_d=machine.ld,
            L_q=machine.lq,
            psi_f=machine.flux,
        )
        mechanics = motulator_model.StiffMechanicalSystem(J=machine.inertia, B_L=machine.viscous)
        mechanics.state.w_M = machine.speed
        self.drive = motulator_model.Drive(
            motulator_model.VoltageSourceConverter(u_dc=machine.bus),
            motulator_model.SynchronousMachine(parameters),
            mechanics,
        )
        if control == "plant":
            controller = OpenLoop(machine)
        else:
            controller = motulator_control.CurrentVectorControl(
                parameters,
                motulator_control.CurrentReferenceCfg(
                    parameters,
                    nom_w_m=machine.pole_pairs * machine.speed,
                    max_i_s=2 * machine.iq,
                ),
                T_s=PERIOD,
                alpha_c=2 * math.pi * 500,
                sensorless=control == "sensorless",
            )
            controller.ref.tau_M = lambda _: machine.torque
            if controller.observer:
                controller.observer.est.w_m = machine.pole_pairs * machine.speed
        self.solver = solver
        self.simulation = motulator_model.Simulation(self.drive, controller)

    def run(self, steps):
        # The package has no option for the solver.
        motulator_simulation.solve_ivp = self.solver
        self.simulation.simulate(t_stop=(steps - 0.5) * PERIOD)

    def speed(self):
        return float(self.drive.mechanics.data.w_M[-1])


MODELS = {
    "gem plant": GemPlant,
    "gem control": GemControl,
    **{
        f"motulator {control} {name}": lambda machine, control=control, solver=solver: Motulator(
            machine, control, solver
        )
        for control in ("plant", "encoder", "sensorless")
        for name, solver in (("rk23", runge_kutta), ("midpoint", midpoint))
    },
}


def main():
    # What the packages print goes to stderr.
    answers, sys.stdout = sys.stdout, sys.stderr

    def answer(value):
        print(json.dumps(value), file=answers, flush=True)

    machine = Machine(json.loads(sys.argv[1]))
    packages = ("motulator", "gym-electric-motor", "numpy", "scipy")
    answer({name: importlib.metadata.version(name) for name in packages})
    for line in sys.stdin:
        name, _, steps = line.strip().rpartition(" ")
        model, steps = MODELS[name](machine), int(steps)
        began = time.process_time()
        model.run(steps)
        seconds = time.process_time() - began
        answer({"steps": steps, "seconds": seconds, "speed_rad_s": float(model.speed())})


main()
