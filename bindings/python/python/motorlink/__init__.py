"""Motor drives from Python: ST's Motor Control Protocol and RMD over CAN.

>>> import motorlink
>>> with motorlink.st.open("sim:") as client:          # or "/dev/ttyACM0"
...     motor = client.motor(1)
...     motor.set_ramp(1500, 1.0)                       # rpm, s
...     motor.get("SPEED_MEAS")
0

``motorlink.st`` and ``motorlink.rmd`` are the two protocols, ``motorlink.sim`` is drives for a program
without hardware. What goes wrong is a :class:`MotorlinkError`. Clients have no thread of their own, and
may be shared between threads.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = [
    "ClosedError",
    "FullTurnError",
    "InvalidValueError",
    "LinkError",
    "MotorlinkError",
    "PortError",
    "RefusedError",
    "ReplyTimeoutError",
    "Sample",
    "Sampling",
    "__version__",
    "aio",
    "can",
    "errors",
    "rmd",
    "sim",
    "st",
    "to_pandas",
]

if TYPE_CHECKING:
    from motorlink import aio, can, errors, rmd, sim, st
    from motorlink._core import __version__
    from motorlink._sampling import Sample, Sampling, to_pandas
    from motorlink.errors import (
        ClosedError,
        FullTurnError,
        InvalidValueError,
        LinkError,
        MotorlinkError,
        PortError,
        RefusedError,
        ReplyTimeoutError,
    )
else:
    _FROM = {"__version__": "motorlink._core"}
    _FROM |= dict.fromkeys(("Sample", "Sampling", "to_pandas"), "motorlink._sampling")

    def __getattr__(name: str) -> Any:
        """A part, loaded when it is first used: the command and pytest's plugin need no NumPy."""
        if name in ("aio", "can", "errors", "rmd", "sim", "st"):
            return import_module(f"motorlink.{name}")
        if name not in __all__:
            raise AttributeError(f"module 'motorlink' has no attribute {name!r}")
        part = import_module(_FROM.get(name, "motorlink.errors"))
        return getattr(part, name)

    def __dir__() -> list[str]:
        return __all__
