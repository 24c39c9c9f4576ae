"""Drives that speak ST's serial Motor Control Protocol.

>>> import motorlink
>>> with motorlink.st.open("sim:") as client:       # or "/dev/ttyACM0"
...     motor = client.motor(1)
...     motor.set("SPEED_KP", 1200)
...     motor.registers.SPEED_KP
1200

Speeds are rpm, times s. Currents are digits of the drive (s16A, of which 32767 is its full scale)
until it is told what full scale is: ``full_scale_amps=17.5`` makes A of them.

Every method of a motor is one exchange unless it says otherwise, and raises

* ``RefusedError`` where the drive says no (table 2 of the document),
* ``ReplyTimeoutError`` and ``LinkError`` where there is no answer to trust: it is unknown whether the drive did it,
* ``InvalidValueError`` where nothing was sent: no such motor, out of range, over a limit; of a register that
  nobody knows, its subclass ``errors.UnknownRegisterError``, which is a ``KeyError``, too,
* ``ClosedError`` after ``client.close()``.

Paragraphs in brackets are those of the document "Motor Control Protocol". Ctrl-C ends a wait for a
silent drive at once; nobody knows then what the drive did, and the next exchange recovers the line
first. ``stop()`` does not wait for that: it is sent at once, and again on the recovered line. While
motors are being stopped at the end Ctrl-C has to wait.

A signal handler may use the client that the main thread waits for, such as ``motor.stop()`` or
``client.close()``. The exchange that it interrupted is given up then and raises ``PortError``. A handler
that does not use the client does not disturb the exchange. If another thread has an exchange under way,
the handler waits until that is over.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorlink import _core
from motorlink._apis import Blocking, carried_out
from motorlink._client import BlockingClient, PortLike, opens
from motorlink._core import StClient as Core
from motorlink._core import StRequest as Request
from motorlink._registers import Registers
from motorlink._sampling import Sampling
from motorlink._scan import Path, ScanResult, scanning
from motorlink._st import StClient, StMotor
from motorlink._values import (
    BoardInfo,
    ControlMode,
    FirmwareVersion,
    Flags,
    RegisterInfo,
    RevupPhase,
    Status,
)

__all__ = [
    "BoardInfo",
    "Client",
    "ControlMode",
    "FirmwareVersion",
    "Flags",
    "Motor",
    "RegisterInfo",
    "Registers",
    "Request",
    "RevupPhase",
    "ScanResult",
    "Status",
    "open",
    "scan",
]


def __dir__() -> list[str]:
    return __all__


class Motor(Blocking, StMotor["Client"]):
    """One motor of a drive; from :meth:`Client.motor`."""

    __slots__ = ()

    @property
    def registers(self) -> Registers:
        """The registers as a mapping: ``motor.registers["SPEED_KP"]``, ``motor.registers.SPEED_KP``."""
        return Registers(self)


class Client(BlockingClient, StClient[Motor, PortLike, Sampling]):
    """A serial line with a drive of up to seven motors; from :func:`open`.

    Threads may share it: one exchange at a time is on the line, and each caller gets its own answer.
    """

    _core: Core
    _Core = Core
    _Motor = Motor
    _Sampling = Sampling

    def __init__(self, core: Core, **options: Any):
        super().__init__(core, **options)
        self._exchange, self._exchange_raw = core.exchange, core.raw
        self._set_verified, self._sample = core.set_verified, core.sample
        self._confirm = core.confirm


open = opens(Client._open)


def scan(
    port: Path,
    rates: Sequence[int] = _core.ST_BAUD_RATES,
    *,
    timeout: float = _core.ST_SCAN_TIMEOUT,
) -> list[ScanResult]:
    """Asks a drive for its board information at each baud rate; gives what each was answered with.

    ``port`` is a serial line. ``timeout`` is how long to wait for each of two answers, s. A port without a
    baud rate, such as ``tcp:``, is asked once. No motor is started or stopped.

    Raises ``PortError`` where the port cannot be opened, and ``InvalidValueError`` for one that is not a
    line or that ends with this process.
    """
    return carried_out(scanning(_core.st_scan_baud, port, rates, timeout))
