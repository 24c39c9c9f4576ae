"""Any bus of python-can as a port of :mod:`motorlink.rmd`.

python-can is an optional extra, ``pip install "motorlink[can]"``. For Linux interfaces and slcan adapters the
ports ``socketcan:`` and ``slcan:`` need none of it and are faster; this is for everything else that
python-can knows.
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
    ...             print("nobody is on this bus")
    nobody is on this bus

    ``bus`` stays the caller's: opened at 1 Mbit/s before, shut down afterwards, and in a process that
    was forked it is the caller who has to close it. Nothing else may receive
    from it meanwhile, no ``can.Notifier`` either: what one receives the other misses. Until the client of
    :func:`motorlink.rmd.open` is closed, one thread calls ``bus.recv`` and another one ``bus.send``.

    Where the bus raises, the exchange fails (``LinkError``, with what was raised as its cause). The next
    call uses the bus again. ``stop`` and ``off`` are sent even if receiving failed before. Ctrl-C is no
    failure: it ends the wait, and the bus stays open.

    Raises ``ImportError`` where python-can is not installed.
    """
    try:
        can = importlib.import_module("can")
    except ImportError as error:
        raise ImportError(
            'python-can is not installed: `pip install "motorlink[can]"`', name="can"
        ) from error
    if not isinstance(bus, can.BusABC):
        raise TypeError(f"this is no bus of python-can: {bus!r}; open one with can.Bus(...)")
    return CanPort(bus, can.Message, f"python-can ({bus.channel_info})")
