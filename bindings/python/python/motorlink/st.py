"""Drives that speak ST's serial Motor Control Protocol.

>>> import motorlink
>>> with motorlink.st.open("sim:") as client:       # or "/dev/ttyACM0"
...     motor = client.motor(1)
...     motor.set("SPEED_KP", 1200)
...     motor.registers.SPEED_KP
1200

Speeds are in rpm, times in s. Currents are in digits of the drive (s16A; 32767 is its full scale). With
``full_scale_amps=17.5`` they are in A.

Each method of a motor is one exchange, unless its docstring says otherwise, and raises

* ``RefusedError`` if the drive refuses (table 2 of the document),
* ``ImplausibleValueError`` if a value is possible in another profile only,
* ``ReplyTimeoutError`` and ``LinkError`` without a valid reply. It is unknown whether the drive
  executed the request,
* ``InvalidValueError`` if nothing was sent: a motor number, a range or a limit. For an unknown register
  it is ``errors.UnknownRegisterError``, which is also a ``KeyError``,
* ``ClosedError`` after ``client.close()``.

Numbers in brackets are paragraphs of the document "Motor Control Protocol".

Ctrl-C ends the wait for a reply at once. It is unknown whether the drive executed the request, and the
next exchange resynchronises the line first. ``stop()`` is sent at once, and again after that. While
motors are stopped at the end, Ctrl-C waits.

A signal handler may use the client that the main thread waits for, for example ``motor.stop()`` or
``client.close()``. The interrupted exchange then raises ``PortError``. A handler that does not use the
client does not disturb the exchange. If another thread has an exchange under way, the handler waits for
its end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from motorlink import _core
from motorlink._apis import Blocking, carried_out
from motorlink._client import BlockingClient, PortLike, opens
from motorlink._core import RecordedClient
from motorlink._core import StClient as Core
from motorlink._core import StRequest as Request
from motorlink._registers import Registers
from motorlink._sampling import Sampling
from motorlink._scan import Path, ScanResult, scanning
from motorlink._settings import Settings
from motorlink._st import StClient
from motorlink._st_motor import StMotor
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


#: Data segments of a recording, if they are free: signals of one motor at two rates.
_RECORDED_SEGMENTS = 2


def __dir__() -> list[str]:
    return __all__


class Motor(Blocking, StMotor["Client"]):
    """One motor of a drive, from :meth:`Client.motor`."""

    __slots__ = ()

    @property
    def registers(self) -> Registers:
        """The registers as a mapping: ``motor.registers["SPEED_KP"]``, ``motor.registers.SPEED_KP``."""
        return Registers(self)

    @property
    def settings(self) -> Settings:
        """The settings as text: ``motor.settings.dump()``, ``diff`` and ``restore``."""
        return Settings(self)


class Client(BlockingClient, StClient[Motor, PortLike, Sampling]):
    """A serial line with a drive of up to seven motors, from :func:`open`.

    Threads may share it. One exchange at a time is on the line, and each thread gets its own reply.
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

    def _recorded(self) -> tuple[RecordedClient, Callable[[], None]]:
        """The client for a recording, and what releases the data segments that it uses."""
        segments, release = self._segments.for_sampling(_RECORDED_SEGMENTS)
        try:
            return self._core.recorded(self._profile, segments), release
        except BaseException:
            release()
            raise


open = opens(Client._open)


def scan(
    port: Path,
    rates: Sequence[int] = _core.ST_BAUD_RATES,
    *,
    timeout: float = _core.ST_SCAN_TIMEOUT,
) -> list[ScanResult]:
    """Asks a drive for its board information at each baud rate. Returns one result for each rate.

    ``port`` is a serial line. ``timeout`` is the time to wait for each of two replies, s. A port without a
    baud rate, such as ``tcp:`` or a pty, is asked once. No motor starts or stops.

    Raises ``PortError`` if the port cannot be opened, ``InvalidValueError`` for a port that is not a serial
    line, or that exists only in this process.
    """
    return carried_out(scanning(_core.st_scan_baud, port, rates, timeout))
