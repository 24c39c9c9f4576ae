"""RMD motors on a CAN bus, protocol V1.62.

>>> import motorlink
>>> with motorlink.rmd.open("sim:") as client:      # or "socketcan:can0", "slcan:/dev/ttyACM0"
...     motor = client.motor(1)
...     status = motor.set_position(90, max_speed_dps=500)
...     motor.status().voltage_volts
24.0

Units are °, °/s, °/s² and A, all at the motor shaft, or at the output shaft with ``open(gear_ratio=6)``.
Positive is clockwise. Each method of a motor is one exchange, unless its docstring says otherwise, and raises

* ``ReplyTimeoutError`` if the motor does not reply. It is unknown whether it executed the request. A
  motor that does not know a command does not reply either,
* ``LinkError`` and ``PortError`` if the line fails, or if the motor speaks another protocol,
* ``InvalidValueError`` if nothing was sent: an ID, a range or a limit,
* ``ClosedError`` after ``client.close()``.

After a timeout the client waits for a late reply before the next request to this motor. ``stop()`` and
``off()`` do not wait. For Ctrl-C and signal handlers see :mod:`motorlink.st`.

A command has the same name as a method of :class:`Motor`, of :class:`Request`, and as a function of
this module. The last two make a request for :meth:`Client.cycle`. Methods of a motor that read have no
``read_``: ``motor.status()`` is ``rmd.read_status()``. The docstring of each has the code and the
paragraph in chapter 3 of the document.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorlink import _core, _rmd_table
from motorlink._apis import Blocking
from motorlink._client import BlockingClient, PortLike, opens
from motorlink._core import CanPort, RecordedClient
from motorlink._core import RmdClient as Core
from motorlink._rmd import RmdClient, ScanResult
from motorlink._rmd_motor import RmdMotor
from motorlink._rmd_table import *
from motorlink._sampling import Sampling
from motorlink._settings import Settings
from motorlink._values import Errors, Frame

__all__ = [
    "QUANTITIES",
    "Client",
    "Errors",
    "Frame",
    "Motor",
    "ScanResult",
    "decode",
    "encoder_degrees",
    "open",
]
__all__ += _rmd_table.__all__


def __dir__() -> list[str]:
    return __all__

#: The names that ``Client.sample`` and ``Client.samples`` can read.
QUANTITIES: tuple[str, ...] = tuple(_core.rmd_quantities())


def decode(can_id: int, data: bytes, *, reply: bool) -> Frame:
    """A frame as text and values. ``reply``: the motor sent it; requests and replies look alike.

    >>> frame = decode(0x141, bytes.fromhex("A100000064000000"), reply=False)
    >>> frame.values
    {'iq_amps': 1.6}
    >>> frame.text
    'motor 1 > 0xA1 Torque closed-loop command: iq 1.600 A'

    Raises ``InvalidValueError`` for a frame of another protocol.
    """
    return _core.rmd_decode(can_id, data, reply=reply)


def encoder_degrees(counts: int, *, encoder_bits: int, gear_ratio: float | None = None) -> float:
    """The angle of encoder counts, °. ``encoder_bits`` is the width of the encoder, 12 to 18.

    >>> encoder_degrees(8192, encoder_bits=14)
    180.0

    Counts are within one turn of the motor shaft. With ``gear_ratio`` the angle is that of the output shaft.

    Raises ``InvalidValueError`` for counts beyond the encoder.
    """
    return _core.rmd_encoder_degrees(counts, encoder_bits=encoder_bits, gear_ratio=gear_ratio)


class Motor(Blocking, RmdMotor["Client"]):
    """One motor on the bus, from :meth:`Client.motor`."""

    __slots__ = ()

    @property
    def settings(self) -> Settings:
        """The settings as text: ``motor.settings.dump()``, ``diff`` and ``restore``."""
        return Settings(self)


class Client(BlockingClient, RmdClient[Motor, "PortLike | CanPort", Sampling]):
    """A CAN bus with RMD motors, from :func:`open`.

    Threads may share it. One exchange or cycle at a time is on the bus, and each thread gets its own reply.
    """

    _core: Core
    _Core = Core
    _Motor = Motor
    _Sampling = Sampling

    def __init__(self, core: Core, **options: Any):
        super().__init__(core, **options)
        self._exchange, self._cycle, self._torque4 = core.exchange, core.cycle, core.set_torque4
        self._scan, self._sample, self._confirm = core.scan, core.sample, core.confirm

    def _recorded(self) -> tuple[RecordedClient, Callable[[], None]]:
        """The client for a recording, and what to call at its end."""
        return self._core.recorded(), lambda: None


open = opens(Client._open)
