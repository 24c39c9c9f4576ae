"""RMD motors on a CAN bus, protocol V1.62.

>>> import motorlink
>>> with motorlink.rmd.open("sim:") as client:      # or "socketcan:can0", "slcan:/dev/ttyACM0"
...     motor = client.motor(1)
...     status = motor.set_position(90, max_speed_dps=500)
...     motor.status().voltage_volts
24.0

Angles are °, speeds °/s, accelerations °/s², torque currents A, all of the motor shaft; positive is
clockwise. Every method of a motor is one exchange and raises

* ``ReplyTimeoutError`` where the motor does not answer; nobody knows then what it did. A motor of this
  protocol cannot refuse: it is silent, too, when it does not know a command,
* ``LinkError`` and ``PortError`` where the line fails, or the motor speaks another protocol,
* ``InvalidValueError`` where nothing was sent: no such motor, out of range, over a limit,
* ``ClosedError`` after ``client.close()``.

Ctrl-C and handlers of signals: as in :mod:`motorlink.st`. A motor that did not answer in time is waited
for before it is told anything else; ``stop()`` and ``off()`` do not wait.

A command is called alike as a method of a motor, as a :class:`Request`, and as a function of this module,
which gives a request for :meth:`Client.cycle`; a method that reads is called without ``read_``. Each says
its code and its paragraph in chapter 3 of the document.
"""

from __future__ import annotations

from typing import Any

from motorlink import _core, _rmd_table
from motorlink._apis import Blocking
from motorlink._client import BlockingClient, PortLike, opens
from motorlink._core import CanPort
from motorlink._core import RmdClient as Core
from motorlink._rmd import RmdClient, RmdMotor, ScanResult
from motorlink._rmd_table import *
from motorlink._sampling import Sampling
from motorlink._values import Errors, Frame

__all__ = [
    "QUANTITIES",
    "Client",
    "Errors",
    "Frame",
    "Motor",
    "ScanResult",
    "decode",
    "open",
]
__all__ += _rmd_table.__all__


def __dir__() -> list[str]:
    return __all__

#: What ``Client.sample`` can read.
QUANTITIES: tuple[str, ...] = tuple(_core.rmd_quantities())


def decode(can_id: int, data: bytes, *, reply: bool) -> Frame:
    """A frame in words and values. Request and reply look alike: say which it is.

    >>> frame = decode(0x141, bytes.fromhex("A100000064000000"), reply=False)
    >>> frame.values
    {'iq_amps': 1.6}
    >>> frame.text
    'motor 1 > 0xA1 Torque closed-loop command: iq 1.600 A'

    Raises ``InvalidValueError`` for a frame that is none of this protocol.
    """
    return _core.rmd_decode(can_id, data, reply=reply)


class Motor(Blocking, RmdMotor["Client"]):
    """One motor on the bus; from :meth:`Client.motor`."""

    __slots__ = ()


class Client(BlockingClient, RmdClient[Motor, "PortLike | CanPort", Sampling]):
    """A CAN bus with RMD motors; from :func:`open`.

    Threads may share it: one exchange or cycle at a time is on the bus, and each caller gets its own
    answer.
    """

    _core: Core
    _Core = Core
    _Motor = Motor
    _Sampling = Sampling

    def __init__(self, core: Core, **options: Any):
        super().__init__(core, **options)
        self._exchange, self._cycle, self._torque4 = core.exchange, core.cycle, core.set_torque4
        self._scan, self._sample, self._confirm = core.scan, core.sample, core.confirm


open = opens(Client._open)
