"""RMD motors on a CAN bus, protocol V1.62.

>>> import motorlink
>>> with motorlink.rmd.open("sim:") as bus:      # or "socketcan:can0", "slcan:/dev/ttyACM0"
...     motor = bus.motor(1)
...     status = motor.move_to(90, max_speed=500)
...     motor.status.voltage_v
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

import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from motorlink import _core
from motorlink._bus import Ending, Port, on_close_checked, opened_can, worn
from motorlink._core import CanPort
from motorlink._core import RmdRequest as Request
from motorlink._sampling import Samples, array, by_motor, skips
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
from motorlink.errors import MotorlinkError

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

_ON_CLOSE = ("stop", "off", "nothing")

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


def open(
    port: Port | CanPort,
    *,
    timeout: float = 0.05,
    guard: float = 0.1,
    current_limit: float | None = None,
    speed_limit: float | None = None,
    angle_limit: float | None = None,
    on_close: str = "stop",
    stop_on_signals: bool = True,
) -> Bus:
    """Opens a CAN bus. Nothing is sent.

    ``port``
        ``socketcan:can0``, ``slcan:/dev/ttyACM0``, ``slcan:tcp:HOST:PORT``, ``sim:`` for simulated
        motors inside the process, or a bus of python-can (:func:`motorlink.can.from_python_can`).
    ``timeout``
        How long to wait for a motor's reply, s.
    ``guard``
        How long after a timeout a late reply is awaited before the motor is asked again, s.
    ``current_limit``, ``speed_limit``, ``angle_limit``
        What no request to any motor may exceed in either direction: A, °/s, ° from zero; also not by
        raw frames. Rounded towards 0 to what a frame can say: 1.0 A allows 0.992 A, as a digit is
        0.016 A. With a speed limit a move needs ``max_speed``. It does not bound the speed under a
        torque command, which is as fast as the load allows. The angle is that of ``move_to``:
        ``turn_to`` names none over all turns, and is not held back by it.
    ``on_close``
        What the end of ``with``, and ``close()``, do to motors that this bus set moving: ``stop``
        (0x81: they hold still), ``off`` (0x80), or ``nothing``.
    ``stop_on_signals``
        SIGTERM and SIGHUP do what ``close()`` does, and then end the program as they would have
        without. Handlers are installed if this is called in the main thread, in place of the default
        action only. The last ``close()`` restores it. ``False``: nothing is installed.

    Raises ``PortError`` where the port cannot be opened.
    """
    on_close_checked(on_close, _ON_CLOSE)
    core = _core.RmdBus.open(
        opened_can(port),
        timeout=timeout,
        guard=guard,
        current_limit_a=current_limit,
        speed_limit_dps=speed_limit,
        angle_limit_deg=angle_limit,
    )
    return Bus(core, on_close=on_close, stop_on_signals=stop_on_signals)


def decode(can_id: int, data: bytes, *, reply: bool) -> Frame:
    """A frame in words and values. Request and reply look alike: say which it is.

    >>> frame = decode(0x141, bytes.fromhex("A100000064000000"), reply=False)
    >>> frame.values
    {'torque_a': 1.6}
    >>> frame.text
    'motor 1 > 0xA1 Torque closed-loop command: torque 1.600 A'

    Raises ``BadValue`` for a frame that is none of this protocol.
    """
    return _core.rmd_decode(can_id, data, reply=reply)


class Bus(Ending):
    """A CAN bus with RMD motors; from :func:`open`.

    Threads may share it: one exchange or cycle at a time is on the bus, and each caller gets its own
    answer.
    """

    def __init__(
        self, core: _core.RmdBus, *, on_close: str = "stop", stop_on_signals: bool = True
    ):
        self._core = core
        stop, off = on_close_checked(on_close, _ON_CLOSE) != "nothing", on_close == "off"
        close = functools.partial(core.close, stop=stop, off=off)
        super().__init__(close, core.port, stop_on_signals=stop_on_signals and stop)

    @property
    def moving(self) -> list[int]:
        """IDs of the motors that this bus gave something to do and that did not stop since."""
        return self._core.moving

    def motor(self, id: int = 1) -> Motor:
        """A motor of the bus, ID 1 to 32."""
        return Motor(self, id)

    def perform(self, motor: int, request: Request) -> Any:
        """One exchange with a motor; gives what the request makes of the reply."""
        return self._core.perform(motor, request)

    def confirm(self, motor: int = 1) -> None:
        """Makes sure that a motor's replies so far went to their own requests, before you rely on what you read:
        one exchange more. A reply that nobody asked for is ``LineLost``: read again.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as bus:
        ...     angle = bus.motor(1).angle
        ...     bus.confirm(1)
        """
        self._core.confirm(motor)

    def cycle(self, requests: Mapping[int, Request]) -> dict[int, Any]:
        """Asks many motors at once; the exchanges overlap. Gives what each answered, by ID.

        >>> import motorlink
        >>> from motorlink import rmd
        >>> with rmd.open("sim:") as bus:
        ...     answers = bus.cycle({1: rmd.speed(100), 2: rmd.torque(0.5), 9: rmd.read_motion()})
        >>> type(answers[1]).__name__, type(answers[9]).__name__
        ('MotionStatus', 'Timeout')

        What fails for one motor is its answer, an exception that is not raised; what fails for the
        line is raised.
        """
        return self._core.cycle(list(requests.items()))

    def torque4(
        self,
        first: float,
        second: float,
        third: float,
        fourth: float,
        *,
        expect: Iterable[int] = (1, 2, 3, 4),
    ) -> dict[int, MotionStatus | MotorlinkError]:
        """Torque currents, A, for motors 1 to 4 in one frame (chapter 4, 0x280).

        Gives what each of the motors in ``expect`` answered; a motor that fails has an exception
        there, which is not raised. Raises ``BadValue`` beyond ±32 A or a limit; nothing is sent then.
        """
        return self._core.torque4((first, second, third, fourth), list(expect))

    def scan(self, ids: Iterable[int] = range(1, 33)) -> list[Found]:
        """Asks every ID for its status; gives what answered, in the order of the answers."""
        return self._core.scan(list(ids))

    def sample(
        self,
        quantities: Mapping[int, Sequence[str]] | Sequence[str],
        *,
        rate: float,
        seconds: float,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> Samples:
        """Reads what motors tell ``rate`` times a second for ``seconds``; gives a structured array.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as bus:
        ...     data = bus.sample({1: ["iq_a", "speed_dps"], 2: ["iq_a"]}, rate=100, seconds=0.1)
        >>> data.dtype.names
        ('t', 'iq_a_1', 'speed_dps_1', 'iq_a_2')

        What there is: :data:`QUANTITIES`. A list of names samples ``motor``, and its fields have no
        number behind them. ``t`` is the moment, s since the first instant, at which the row's first
        requests left. Motors are asked in the same cycles; quantities of different commands take one
        cycle each. Instants do not drift; one that the bus was too slow for is missing, and no row is
        ever made up.

        A row that fails raises, with what was sampled before in the exception's ``samples``; with
        ``on_error="skip"`` a motor that fails costs the row only. Ctrl-C ends it, with ``samples`` too.
        """
        skip = skips(on_error)
        motors, names = by_motor(quantities, motor, str)
        return array(self._core.sample(motors, rate, seconds, raw, skip), names, raw=raw)

    def __repr__(self) -> str:
        closed = ", closed" if self._core.is_closed else ""
        return f"<motorlink.rmd.Bus {self.port}{closed}>"


class Motor:
    """One motor on the bus; from :meth:`Bus.motor`."""

    def __init__(self, bus: Bus, id: int):
        self._bus = bus
        self._id = _core.rmd_motor(id)

    @property
    def bus(self) -> Bus:
        """The bus."""
        return self._bus

    @property
    def id(self) -> int:
        """The motor's ID."""
        return self._id

    def _perform(self, request: Request) -> Any:
        return self._bus.perform(self._id, request)

    def set_limits(
        self,
        *,
        current: float | None = None,
        speed: float | None = None,
        angle: float | None = None,
    ) -> None:
        """What this motor may be told from now on, A, °/s, ° from zero; ``None`` is no limit.

        All three at once, in place of those of :func:`open`, and rounded as they are.
        """
        self._bus._core.set_limits(self._id, current, speed, angle)

    @property
    def status(self) -> MotorStatus:
        """Temperature, supply voltage and errors (Read motor status 1 and error flag commands)."""
        status: MotorStatus = self._perform(Request.read_status())
        return status

    @property
    def motion(self) -> MotionStatus:
        """Temperature, torque current, speed and encoder position (Read motor status 2)."""
        status: MotionStatus = self._perform(Request.read_motion())
        return status

    @property
    def phase_currents(self) -> PhaseCurrents:
        """The three phase currents, A (Read motor status 3)."""
        currents: PhaseCurrents = self._perform(Request.read_phase_currents())
        return currents

    @property
    def angle(self) -> float:
        """The angle over all turns, ° (Read multi turns angle command)."""
        angle: float = self._perform(Request.read_angle())
        return angle

    @property
    def circle_angle(self) -> float:
        """The angle within the turn, 0 to 359.99 ° (Read single circle angle command)."""
        angle: float = self._perform(Request.read_circle_angle())
        return angle

    @property
    def encoder(self) -> Encoder:
        """What the encoder reads, in counts (Read encoder data command)."""
        encoder: Encoder = self._perform(Request.read_encoder())
        return encoder

    def clear_errors(self) -> MotorStatus:
        """Clears the errors whose cause is gone; gives what is left (Clear motor error flag command)."""
        status: MotorStatus = self._perform(Request.clear_errors())
        return status

    def torque(self, amps: float) -> MotionStatus:
        """Holds a torque current, within ±32 A (Torque current control command)."""
        status: MotionStatus = self._perform(Request.torque(amps))
        return status

    def speed(self, dps: float) -> MotionStatus:
        """Holds a speed, °/s (Speed control command)."""
        status: MotionStatus = self._perform(Request.speed(dps))
        return status

    def move_to(self, degrees: float, max_speed: float | None = None) -> MotionStatus:
        """Turns to an angle over all turns, °, no faster than ``max_speed``, °/s.

        ``max_speed`` is 1 at least and is rounded down to whole °/s. Position control commands 1
        and 2. Gives the motion as it was when the command came.
        """
        status: MotionStatus = self._perform(Request.move_to(degrees, max_speed))
        return status

    def turn_to(
        self,
        degrees: float,
        max_speed: float | None = None,
        *,
        clockwise: bool = True,
        full_turn: bool = False,
        tolerance: float = 0.5,
    ) -> MotionStatus:
        """Turns to an angle within the turn, 0 to 359.99 °, this way round.

        No faster than ``max_speed``, °/s, 1 at least, rounded down. Position control commands 3
        and 4.

        The motor is asked for its angle first. At its target, or up to ``tolerance`` ° past it, the
        move could be nearly a full turn: ``FullTurn`` is raised, and the motor is not moved. It
        is not asked with ``full_turn=True``.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as bus:     # the motor is at 0 °
        ...     bus.motor(1).turn_to(0)
        Traceback (most recent call last):
        motorlink.errors.FullTurn: motor 1 is at 0.00°, 0.00° past 0.00° clockwise: ...
        """
        request = Request.turn_to(degrees, max_speed, clockwise=clockwise)
        if not full_turn:
            request.check_full_turn(self._id, self.circle_angle, tolerance)
        status: MotionStatus = self._perform(request)
        return status

    def off(self) -> None:
        """Switches the motor off; it forgets what it was doing (Motor off command)."""
        self._perform(Request.off())

    def stop(self) -> None:
        """Stops the motor; it holds still and remembers what it was doing (Motor stop command)."""
        self._perform(Request.stop())

    def run(self) -> None:
        """Resumes what :meth:`stop` stopped (Motor running command)."""
        self._perform(Request.run())

    @property
    def gains(self) -> Gains:
        """The gains in RAM. Set them until power-off by assignment; :meth:`write_gains` for good.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as bus:
        ...     motor = bus.motor(1)
        ...     motor.gains = motor.gains._replace(speed_kp=50)
        ...     motor.gains.speed_kp
        50
        """
        gains: Gains = self._perform(Request.read_gains())
        return gains

    @gains.setter
    def gains(self, gains: Gains) -> None:
        self.write_gains(gains)

    def write_gains(self, gains: Gains, *, rom: bool = False) -> None:
        """Sets the gains until power-off, or with ``rom=True`` for good, which wears the ROM.

        Write PID to RAM, and to ROM, parameter command.
        """
        self._perform(Request.write_gains(*gains, rom=rom))

    @property
    def acceleration(self) -> int:
        """The acceleration limit, °/s²; 0 is none. Set it until power-off by assignment (0x33, 0x34)."""
        limit: int = self._perform(Request.read_acceleration())
        return limit

    @acceleration.setter
    def acceleration(self, dps2: float) -> None:
        self._perform(Request.write_acceleration(dps2))

    def write_encoder_offset(self, counts: int, *, rom: bool) -> int:
        """Sets the encoder's zero, in counts, at once and for good, which wears the ROM: ``rom=True``.

        Gives the offset that the motor took (Write encoder offset command).
        """
        worn(rom, "the encoder offset")
        offset: int = self._perform(Request.write_encoder_offset_to_rom(counts))
        return offset

    def write_zero(self, *, rom: bool) -> int:
        """Makes the position the zero from the next power-on on, which wears the ROM: ``rom=True``.

        Gives the new offset, in counts (Write current position to ROM as motor zero position command).
        """
        worn(rom, "the zero")
        offset: int = self._perform(Request.write_zero_to_rom())
        return offset

    def exchange_raw(self, data: bytes, *, rom: bool = False) -> bytes:
        """One exchange with any eight bytes; ``rom=True`` allows those that wear the ROM."""
        reply: bytes = self._perform(Request.raw(data, rom=rom))
        return reply

    def __repr__(self) -> str:
        return f"<motorlink.rmd.Motor {self._id} on {self._bus.port}>"
