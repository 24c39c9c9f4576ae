"""A loop over four RMD motors: each holds its position like a spring with a damper.

    python torque_loop.py

The computer closes the loop: one frame sends four torques, four replies bring speeds and positions,
a thousand times a second. Then two of the motors are pushed.
"""

# %% The bench
# Four motors with a small flywheel each. On virtual time the loop is exact, also on a slow computer.
# On a real bus, open `motorlink.rmd.open("socketcan:can0")`.
import math
import time

import numpy as np

from motorlink import sim

bench = sim.Bench(
    "\n".join(f"[[rmd.motor]]\nid = {n}\nplant.load.inertia = 1e-4" for n in (1, 2, 3, 4))
)
client = bench.rmd
RATE = 1000  # Hz
SECONDS = 4.0
STIFFNESS = 0.1  # A per degree
DAMPING = 0.002  # A per degree per second
LIMIT = 3.0  # A
COUNTS = 2**14  # of the encoder in a turn

# %% Angles
# A reply has the position within the turn. The angle over all turns is the sum of its smallest changes.
# This is correct below half a turn per cycle: 180 000 degrees per second.
angles = [client.motor(n).multi_turn_angle() for n in (1, 2, 3, 4)]
counts = [client.motor(n).motion_status().encoder for n in (1, 2, 3, 4)]


def follow(motor, encoder):
    change = (encoder - counts[motor] + COUNTS // 2) % COUNTS - COUNTS // 2
    counts[motor] = encoder
    angles[motor] += change * 360 / COUNTS


# %% Target positions
# Motors 1 and 2 swing, against each other; 3 and 4 stay.
def wanted(t):
    """Angles in degrees, and speeds in degrees per second."""
    turn = 2 * math.pi * 0.5
    swing, speed = 45 * math.sin(turn * t), 45 * turn * math.cos(turn * t)
    return (swing, -swing, 0.0, 0.0), (speed, -speed, 0.0, 0.0)


# %% The loop
began, bench_began = time.perf_counter(), bench.now
speeds = [0.0] * 4
lost = 0
pushes = {1.5: ("rmd3", 0.1), 2.5: ("rmd3", 0.0), 2.0: ("rmd2", -0.05), 3.0: ("rmd2", 0.0)}
deviations = []
signals = [f"rmd{n}.output_degrees" for n in (1, 2, 3, 4)]
with client, bench.recording(signals, every=1 / RATE) as recording:
    for cycle in range(int(SECONDS * RATE)):
        t = cycle / RATE
        if t in pushes:
            bench.push(*pushes[t])
        targets, speed_targets = wanted(t)
        deviations.append([angle - target for angle, target in zip(angles, targets)])
        torques = []
        for motor in range(4):
            spring = STIFFNESS * (targets[motor] - angles[motor])
            damper = DAMPING * (speed_targets[motor] - speeds[motor])
            torques.append(max(-LIMIT, min(LIMIT, spring + damper)))
        for number, reply in client.set_torque4(torques).items():
            if isinstance(reply, Exception):
                lost += 1
                continue
            follow(number - 1, reply.encoder)
            speeds[number - 1] = reply.speed_dps
        # The rest of the period.
        bench.run(max(0.0, bench_began + (cycle + 1) / RATE - bench.now))

# %% The figures
real = time.perf_counter() - began
virtual = bench.now - bench_began
cycles = len(deviations)
print(f"{cycles} cycles in {virtual:.2f} s of the bench: {cycles / virtual:.0f} Hz, {lost} replies lost")
print(f"{cycles / real:.0f} cycles a second of this computer, the motors included")
deviations = np.array(deviations)
t = np.arange(cycles) / RATE
for name, span in (("undisturbed", t < 1.5), ("pushed", (t >= 1.5) & (t < 3)), ("at the end", t > 3.8)):
    rms = np.sqrt((deviations[span] ** 2).mean(axis=0))
    told = "  ".join(f"{degrees:6.2f}" for degrees in rms)
    print(f"{name:12} deviation of motors 1 to 4, rms: {told}  degrees")

# The angles of the loop and the real angles.
truth = np.array([recording.data[name] for name in signals]).T[:cycles]
believed = deviations + np.array([wanted(moment)[0] for moment in t])
lag = np.abs(truth - believed).max()
print(f"the angles it followed, a cycle old, were right within {lag:.2f} degrees")
