"""Any bus of python-can as a port of :mod:`motorlink.rmd`.

python-can is optional: ``pip install "motorlink[can]"``. The ports ``socketcan:`` and ``slcan:`` do not
need it and are faster. Use this module for the other adapters that python-can supports.
"""

from __future__ import annotations

import importlib
from typing import Any

from motorlink._core import CanPort

__all__ = ["CanPort", "from_python_can"]


def __dir__() -> list[str]:
    return __all__


def from_python_can(bus: Any) -> CanPort:
    """A port for :func:`motorlink.rmd.open` and :func:`motorlink.aio.rmd.open`.

    >>> import can, motorlink
    >>> with can.Bus("motors", interface="virtual") as bus:
    ...     port = motorlink.can.from_python_can(bus)
    ...     with motorlink.rmd.open(port, timeout=0.01) as motors:
    ...         try:
    ...             motors.motor(1).status()
    ...         except motorlink.ReplyTimeoutError as error:
    ...             print("no reply")
    no reply

    Open ``bus`` at 1 Mbit/s before, and shut it down afterwards. Receive nothing else from it meanwhile,
    also not with a ``can.Notifier``: frames would be lost. While the client is open, one thread calls
    ``bus.recv`` and another one ``bus.send``. In a forked process, shut the bus down there too.

    If the bus raises, the exchange raises ``LinkError`` with that exception as its cause. The next call
    uses the bus again. ``stop`` and ``off`` are sent even if receiving failed before. Ctrl-C ends the wait,
    and the bus stays open.

    Raises ``ImportError`` if python-can is not installed, ``TypeError`` for another object.
    """
    try:
        can = importlib.import_module("can")
    except ImportError as error:
        raise ImportError(
            'python-can is not installed: `pip install "motorlink[can]"`', name="can"
        ) from error
    if not isinstance(bus, can.BusABC):
        raise TypeError(f"{bus!r} is not a bus of python-can: open one with can.Bus(...)")
    return CanPort(bus, can.Message, f"python-can ({bus.channel_info})")
