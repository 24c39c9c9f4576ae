"""RMD motors on a CAN bus, protocol V1.62.

>>> import motorlink
>>> with motorlink.rmd.open("sim:") as bus:      # or "socketcan:can0", "slcan:/dev/ttyACM0"
...     motor = bus.motor(1)
...     status = motor.move_to(90, max_speed=500)
...     motor.status().voltage_v
24.0

Angles are °, speeds °/s, accelerations °/s², torque currents A, all of the motor shaft; positive is
clockwise. Every method of a motor is one exchange and raises

* ``Timeout`` where the motor does not answer; nobody knows then what it did. There is no refusal in
  this protocol: a motor that does not know a command is silent, too,
* ``LineLost`` and ``PortError`` where the line fails, or the motor speaks another protocol,
* ``BadValue`` where nothing was sent: no such motor, out of range, over a limit,
* ``Closed`` after ``bus.close()``.

Ctrl-C and handlers of signals: as in :mod:`motorlink.st`. A motor that did not answer in time is waited
for before it is told anything else; ``stop()`` and ``off()`` do not wait.

Names in brackets are paragraphs of chapter 3 of the document, or codes of commands.
"""

from __future__ import annotations

from typing import Any

from motorlink import _core
from motorlink._apis import Blocking
from motorlink._bus import BlockingBus, Port, opens
from motorlink._core import CanPort
from motorlink._core import RmdBus as Core
from motorlink._core import RmdRequest as Request
from motorlink._rmd import RmdBus, RmdMotor
from motorlink._values import (
    Encoder,
    Found,
    Frame,
    Gains,
    MotionStatus,
    MotorErrors,
    MotorStatus,
    PhaseCurrents,
)

__all__ = [
    "QUANTITIES",
    "Bus",
    "Encoder",
    "Found",
    "Frame",
    "Gains",
    "MotionStatus",
    "Motor",
    "MotorErrors",
    "MotorStatus",
    "PhaseCurrents",
    "Request",
    "decode",
    "move_to",
    "off",
    "open",
    "read_angle",
    "read_motion",
    "read_phase_currents",
    "read_status",
    "run",
    "speed",
    "stop",
    "torque",
    "turn_to",
]

#: What ``Bus.sample`` can read.
QUANTITIES: tuple[str, ...] = tuple(_core.rmd_quantities())

# Requests for ``Bus.cycle``, sent as they are: ``turn_to`` is not checked for a full turn.
torque = Request.torque
speed = Request.speed
move_to = Request.move_to
turn_to = Request.turn_to
stop = Request.stop
off = Request.off
run = Request.run
read_status = Request.read_status
read_motion = Request.read_motion
read_phase_currents = Request.read_phase_currents
read_angle = Request.read_angle


def decode(can_id: int, data: bytes, *, reply: bool) -> Frame:
    """A frame in words and values. Request and reply look alike: say which it is.

    >>> frame = decode(0x141, bytes.fromhex("A100000064000000"), reply=False)
    >>> frame.values
    {'iq_a': 1.6}
    >>> frame.text
    'motor 1 > 0xA1 Torque closed-loop command: iq 1.600 A'

    Raises ``BadValue`` for a frame that is none of this protocol.
    """
    return _core.rmd_decode(can_id, data, reply=reply)


class Motor(Blocking, RmdMotor["Bus"]):
    """One motor on the bus; from :meth:`Bus.motor`."""

    __slots__ = ()


class Bus(BlockingBus, RmdBus[Motor, "Port | CanPort"]):
    """A CAN bus with RMD motors; from :func:`open`.

    Threads may share it: one exchange or cycle at a time is on the bus, and each caller gets its own
    answer.
    """

    _core: Core
    _Core = Core
    _Motor = Motor

    def __init__(self, core: Core, **options: Any):
        super().__init__(core, **options)
        self._exchange, self._cycle, self._torque4 = core.perform, core.cycle, core.torque4
        self._scan, self._sample = core.scan, core.sample

    def confirm(self, motor: int = 1) -> None:
        """Makes sure that a motor's replies so far went to their own requests, before you rely on what you read:
        one exchange more. A reply that nobody asked for is ``LineLost``: read again.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as bus:
        ...     angle = bus.motor(1).angle()
        ...     bus.confirm(1)
        """
        self._core.confirm(motor)


open = opens(Bus._open)
