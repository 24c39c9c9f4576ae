"""PI tuning: better gains for the speed loop of an ST drive, found by step responses.

    python pi_tuning.py [PICTURE]      # pi_tuning.svg by default; needs matplotlib

The motor is a simulated one that drives a flywheel it was not tuned for. The method is the same on a
real drive; there, begin with small steps.
"""

# %% The bench
# More than the inertia of the rotor comes on top of it, on the shaft: the gains do not know of that.
import sys

import numpy as np

import motorlink
from motorlink import sim

BENCH = """
[[st.motor]]
preset = "servo"
plant.load.inertia = 2e-5      # kg m²
"""
LOW, HIGH = 1000, 1500  # rpm
BRAKE = 0.1  # Nm
DEAD = 0.1  # s before the step
STEP, LOAD = DEAD, 0.5  # s: the times of the speed step and of the brake
SECONDS = 0.9


# %% One experiment
# Write the gains, run the motor at the low speed, step the speed, and brake. A recording has the real
# signals of the motor. Each experiment has a new bench, so it begins in the same state. It takes some
# milliseconds of real time.
def experiment(kp, ki):
    bench = sim.Bench(BENCH)
    motor = bench.st.motor(1)
    if kp:
        motor.set("SPEED_KP", kp)
        motor.set("SPEED_KI", ki)
    motor.set_ramp(LOW, 0)
    motor.start()
    bench.run(2.5)
    with bench.recording(["st1.speed_rpm", "st1.iq_amps"]) as recording:
        bench.run(STEP)
        motor.set_ramp(HIGH, 0)
        bench.run(LOAD - STEP)
        bench.brake("st1", BRAKE)
        bench.run(SECONDS - LOAD)
    return recording.data, motor.get("SPEED_KP"), motor.get("SPEED_KI")


# %% The cost
# The mean error after the step and under the brake. An overshoot of more than 5 % of the step adds to
# the cost. So does a current ripple.
def judge(data):
    t, speed, iq = data["t"], data["st1.speed_rpm"], data["st1.iq_amps"]
    wanted = np.where(t < STEP, LOW, HIGH)
    after_step, after_load = (t >= STEP) & (t < LOAD), t >= LOAD
    error = np.abs(speed - wanted)
    return {
        "overshoot_rpm": speed[after_step].max() - HIGH,
        "dip_rpm": HIGH - speed[after_load].min(),
        "error_rpm": error[after_step | after_load].mean(),
        "ripple_amps": iq[t < STEP].std(),
    }


def cost(figures):
    too_far = max(0.0, figures["overshoot_rpm"] - 0.05 * (HIGH - LOW))
    return figures["error_rpm"] + too_far + 20 * figures["ripple_amps"]


# %% The search
# Begin with the gains of the drive. Multiply or divide them by a factor as long as the cost decreases.
# Continue with smaller factors.
def search(kp, ki):
    tried = {}

    def try_gains(gains):
        if gains not in tried:
            tried[gains] = cost(judge(experiment(*gains)[0]))
        return tried[gains]

    best = (kp, ki)
    for factor in (2.0, 1.4, 1.15):
        while True:
            around = [
                (min(round(best[0] * up), 32767), min(round(best[1] * side), 32767))
                for up, side in ((factor, 1), (1 / factor, 1), (1, factor), (1, 1 / factor))
            ]
            nearest = min(around, key=try_gains)
            if try_gains(nearest) >= try_gains(best):
                break
            best = nearest
    return best, len(tried)


before, kp, ki = experiment(None, None)
(new_kp, new_ki), runs = search(kp, ki)
after, _, _ = experiment(new_kp, new_ki)

# %% The figures
table = [("as it was", kp, ki, judge(before)), ("tuned", new_kp, new_ki, judge(after))]
print(f"{runs} experiments")
print(f"{'':10} {'Kp':>6} {'Ki':>6} {'overshoot':>10} {'dip':>8} {'error':>8} {'ripple':>8}")
for name, p, i, figures in table:
    print(
        f"{name:10} {p:6} {i:6} {figures['overshoot_rpm']:6.0f} rpm {figures['dip_rpm']:4.0f} rpm "
        f"{figures['error_rpm']:4.0f} rpm {figures['ripple_amps']:6.2f} A"
    )
assert cost(judge(after)) < cost(judge(before))


# %% The picture
def draw(path):
    try:
        import matplotlib
    except ImportError:
        print("no picture: `pip install matplotlib` for one")
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (speeds, currents) = pyplot.subplots(2, sharex=True, figsize=(8, 6), layout="constrained")
    t = before["t"]
    speeds.plot(t, np.where(t < STEP, LOW, HIGH), color="0.6", linestyle="--", label="wanted")
    for data, colour, label in (
        (before, "tab:blue", f"as it was: Kp {kp}, Ki {ki}"),
        (after, "tab:orange", f"tuned: Kp {new_kp}, Ki {new_ki}"),
    ):
        speeds.plot(t, data["st1.speed_rpm"], color=colour, label=label)
        currents.plot(t, data["st1.iq_amps"], color=colour)
    for axis in (speeds, currents):
        axis.axvline(LOAD, color="0.8", zorder=0)
        axis.grid(alpha=0.3)
        axis.margins(x=0)
    speeds.set_title(f"A step of {HIGH - LOW} rpm, and a brake of {BRAKE} Nm")
    speeds.set_ylabel("speed / rpm")
    speeds.legend(loc="lower right")
    currents.set_ylabel("torque current Iq / A")
    currents.set_xlabel("time / s")
    figure.savefig(path)
    print("picture ", path)


draw(sys.argv[1] if len(sys.argv) > 1 else "pi_tuning.svg")
