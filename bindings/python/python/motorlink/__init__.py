"""Command and read motor drives: ST's Motor Control Protocol and RMD over CAN.

>>> import motorlink
>>> with motorlink.st.open("sim:") as client:          # or "/dev/ttyACM0"
...     motor = client.motor(1)
...     motor.set_ramp(1500, 1.0)                       # rpm, s
...     motor.get("SPEED_MEAS")
0

=======================  =====================================================================
``motorlink.st``         ST drives on a serial line: ``open``, ``scan``, ``Client``, ``Motor``
``motorlink.rmd``        RMD motors on a CAN bus: ``open``, ``Client``, ``Motor``, requests
``motorlink.aio``        both protocols for asyncio: ``aio.st``, ``aio.rmd``
``motorlink.can``        any bus of python-can as a port
``motorlink.recording``  recordings of motors: ``motorlink.record``, ``motorlink.read``
``motorlink.sim``        simulated drives in the process, for tests without hardware
``motorlink.errors``     the exceptions; all are a ``MotorlinkError``
=======================  =====================================================================

``help(motorlink.st.Motor)`` lists the methods of an ST motor, with their units and errors. The end of
``with`` stops the motors that the client started. Clients have no thread of their own. Threads may
share a client.

docs/PYTHON.md is the guide and the complete reference.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = [
    "ClosedError",
    "FullTurnError",
    "ImplausibleValueError",
    "InvalidValueError",
    "LinkError",
    "MotorlinkError",
    "NotArrivedError",
    "PortError",
    "RecordingError",
    "RecordingWarning",
    "RefusedError",
    "ReplyTimeoutError",
    "Sample",
    "Sampling",
    "SettingDifference",
    "Settings",
    "SettingsDump",
    "SettingsError",
    "__version__",
    "aio",
    "can",
    "errors",
    "read",
    "record",
    "recording",
    "rmd",
    "sim",
    "st",
    "to_pandas",
]

if TYPE_CHECKING:
    from motorlink import aio, can, errors, recording, rmd, sim, st
    from motorlink._core import __version__
    from motorlink._sampling import Sample, Sampling, to_pandas
    from motorlink._settings import SettingDifference, Settings, SettingsDump
    from motorlink.errors import (
        ClosedError,
        FullTurnError,
        ImplausibleValueError,
        InvalidValueError,
        LinkError,
        MotorlinkError,
        NotArrivedError,
        PortError,
        RecordingError,
        RecordingWarning,
        RefusedError,
        ReplyTimeoutError,
        SettingsError,
    )
    from motorlink.recording import read, record
else:
    _FROM = {"__version__": "motorlink._core"}
    _FROM |= dict.fromkeys(("Sample", "Sampling", "to_pandas"), "motorlink._sampling")
    _FROM |= dict.fromkeys(("SettingDifference", "Settings", "SettingsDump"), "motorlink._settings")

    _FROM |= dict.fromkeys(("read", "record"), "motorlink.recording")

    def __getattr__(name: str) -> Any:
        """A part, loaded when it is first used: the command and pytest's plugin need no NumPy."""
        if name in ("aio", "can", "errors", "recording", "rmd", "sim", "st"):
            return import_module(f"motorlink.{name}")
        if name not in __all__:
            raise AttributeError(f"module 'motorlink' has no attribute {name!r}")
        part = import_module(_FROM.get(name, "motorlink.errors"))
        return getattr(part, name)

    def __dir__() -> list[str]:
        return __all__
