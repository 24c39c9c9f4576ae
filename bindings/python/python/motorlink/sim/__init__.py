"""Simulated drives in the process: motors with physics, without hardware.

>>> from motorlink import sim
>>> bench = sim.Bench()
>>> motor = bench.st.motor(2)                # a 24 V servo; motor 1 is a bigger one
>>> motor.set_ramp(1000, 0.2)                    # rpm, s
>>> motor.start()
>>> bench.run(3.0)                           # s of virtual time
>>> round(motor.get("SPEED_MEAS"), -1)      # rpm
1000
>>> bench.brake("st2", 0.05)                 # Nm
>>> bench.run(1.0)
>>> round(bench.truth("st2")["torque_newton_metres"], 2)     # with friction
0.06

Time is *virtual*. It advances during an exchange, during the wait for a timeout, and in
:meth:`Bench.run`. Nothing sleeps. The same calls from one thread give the same results each time, noise
and faults of the line included.

The names of motors are those of signals: ``st2`` is motor 2 of the ST drive, ``rmd3`` the RMD motor with
ID 3. docs/SIMULATOR.md describes configurations, docs/SCENARIOS.md the signals.
"""

from motorlink.sim._bench import Bench, BenchPort
from motorlink.sim._recording import Recording
from motorlink.sim._scenario import Expectation, Mark, Refusal, Run, presets, run
from motorlink.sim._serving import Serving

__all__ = [
    "Bench",
    "BenchPort",
    "Expectation",
    "Mark",
    "Recording",
    "Refusal",
    "Run",
    "Serving",
    "presets",
    "run",
]


def __dir__() -> list[str]:
    return __all__
