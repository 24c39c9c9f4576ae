"""Motor drives from Python: ST's Motor Control Protocol and RMD over CAN.

>>> import motorlink
>>> with motorlink.st.open("sim:") as bus:          # or "/dev/ttyACM0"
...     motor = bus.motor(1)
...     motor.ramp(1500, 1.0)                       # rpm, s
...     motor.read("SPEED_MEAS")
0

``motorlink.st`` and ``motorlink.rmd`` are the two protocols, ``motorlink.sim`` is drives for a program
without hardware. What goes wrong is a
:class:`MotorlinkError`. Nothing here has a thread of its own; buses may be shared between threads.
"""

from motorlink import _core, errors, rmd, sim, st
from motorlink._sampling import to_pandas
from motorlink.errors import (
    BadValue,
    Closed,
    LineLost,
    MotorlinkError,
    PortError,
    Refused,
    Timeout,
)

__version__: str = _core.__version__

__all__ = [
    "BadValue",
    "Closed",
    "LineLost",
    "MotorlinkError",
    "PortError",
    "Refused",
    "Timeout",
    "__version__",
    "errors",
    "rmd",
    "sim",
    "st",
    "to_pandas",
]
