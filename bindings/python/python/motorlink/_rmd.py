"""Buses and motors of the RMD protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, one
from motorlink._bus import AnyBus
from motorlink._core import CanPort
from motorlink._core import RmdRequest as Request
from motorlink._sampling import Samples, array, by_motor, skips
from motorlink._values import Encoder, Found, Gains, MotionStatus, MotorStatus, PhaseCurrents
from motorlink.errors import BadValue, MotorlinkError

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound="RmdMotor[Any]")
PortT = TypeVar("PortT")
BusT = TypeVar("BusT", bound="RmdBus[Any, Any]")


class RmdBus(AnyBus, Generic[MotorT, PortT]):
    """The buses of both APIs."""

    _ENDS: ClassVar[dict[str, dict[str, bool]]] = {
        "stop": {"stop": True, "off": False},
        "off": {"stop": True, "off": True},
        "nothing": {"stop": False, "off": False},
    }
    _Motor: type[MotorT]
    # Each API's exchanges, with the arguments of the methods of the extension's ``RmdBus``.
    _exchange: Any
    _cycle: Any
    _torque4: Any
    _scan: Any
    _sample: Any

    def __init__(self, core: Any, *, on_close: str = "stop", stop_on_signals: bool = True):
        super().__init__(core, on_close=on_close, stop_on_signals=stop_on_signals)

    @classmethod
    def _open(
        cls,
        port: PortT,
        *,
        timeout: float = 0.05,
        guard: float = 0.1,
        current_limit: float | None = None,
        speed_limit: float | None = None,
        angle_limit: float | None = None,
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ) -> Callable[[], Exchanges[Self]]:
        """Opens a CAN bus. Nothing is sent.

        For asyncio: ``async with open(...) as bus``, or ``await open(...)``.

        ``port``
            ``socketcan:can0``, ``slcan:/dev/ttyACM0``, ``slcan:tcp:HOST:PORT``, ``sim:`` for simulated
            motors inside the process, a bus of python-can (:func:`motorlink.can.from_python_can`), or,
            not for asyncio, a bench of ``motorlink.sim``.
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
            action only. The last ``close()`` restores it. ``False``: nothing is installed. For asyncio
            the motors are stopped with the event loop at rest.

        Raises ``PortError`` where the port cannot be opened.
        """
        options = _core.RmdOptions(
            timeout=timeout,
            guard=guard,
            current_limit_a=current_limit,
            speed_limit_dps=speed_limit,
            angle_limit_deg=angle_limit,
        )
        name = port if isinstance(port, CanPort) else cls._named(port)
        return cls._opening(
            functools.partial(cls._Core.open, name, options),
            on_close=on_close,
            stop_on_signals=stop_on_signals,
        )

    @property
    def moving(self) -> list[int]:
        """IDs of the motors that this bus gave something to do and that did not stop since."""
        moving: list[int] = self._core.moving
        return moving

    def motor(self, id: int = 1) -> MotorT:
        """A motor of the bus, ID 1 to 32."""
        return self._Motor(self, id)

    @both_apis
    def perform(self, motor: int, request: Request) -> Exchanges[Any]:
        """One exchange with a motor; gives what the request makes of the reply."""
        return one(self._exchange(motor, request))

    @both_apis
    def cycle(self, requests: Mapping[int, Request]) -> Exchanges[dict[int, Any]]:
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
        return one(self._cycle(list(requests.items())))

    @both_apis
    def torque4(
        self,
        first: float,
        second: float,
        third: float,
        fourth: float,
        *,
        expect: Iterable[int] = (1, 2, 3, 4),
    ) -> Exchanges[dict[int, MotionStatus | MotorlinkError]]:
        """Torque currents, A, for motors 1 to 4 in one frame (chapter 4, 0x280).

        Gives what each of the motors in ``expect`` answered; a motor that fails has an exception
        there, which is not raised. Raises ``BadValue`` beyond ±32 A or a limit; nothing is sent then.
        """
        return one(self._torque4((first, second, third, fourth), list(expect)))

    @both_apis
    def scan(self, ids: Iterable[int] = range(1, 33)) -> Exchanges[list[Found]]:
        """Asks every ID for its status; gives what answered, in the order of the answers; for asyncio, in
        that of the IDs."""
        return one(self._scan(list(ids)))

    @both_apis
    def sample(
        self,
        quantities: Mapping[int, Sequence[str]] | Sequence[str],
        *,
        rate: float,
        seconds: float,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> Exchanges[Samples]:
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
        ``on_error="skip"`` a motor that fails costs the row only. Ctrl-C ends it, with ``samples`` too; so
        does the cancellation of a task. Exchanges of other tasks have their turns in between.
        """
        skip = skips(on_error)
        motors, names = by_motor(quantities, motor, str)
        outcome = yield self._sample(motors, rate, seconds, raw, skip)
        return array(outcome, names, raw=raw)

    def __repr__(self) -> str:
        return self._text()


class RmdMotor(Generic[BusT]):
    """The motors of both APIs."""

    __slots__ = ("__weakref__", "_bus", "_id")

    def __init__(self, bus: BusT, id: int):
        self._bus = bus
        self._id = _core.rmd_motor(id)

    @property
    def bus(self) -> BusT:
        """The bus."""
        return self._bus

    @property
    def id(self) -> int:
        """The motor's ID."""
        return self._id

    def _perform(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._bus._exchange(self._id, request)
        return given

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

    @both_apis
    def status(self) -> Exchanges[MotorStatus]:
        """Temperature, supply voltage and errors (Read motor status 1 and error flag commands)."""
        return self._perform(Request.read_status())

    @both_apis
    def motion(self) -> Exchanges[MotionStatus]:
        """Temperature, torque current, speed and encoder position (Read motor status 2)."""
        return self._perform(Request.read_motion())

    @both_apis
    def phase_currents(self) -> Exchanges[PhaseCurrents]:
        """The three phase currents, A (Read motor status 3)."""
        return self._perform(Request.read_phase_currents())

    @both_apis
    def angle(self) -> Exchanges[float]:
        """The angle over all turns, ° (Read multi turns angle command)."""
        return self._perform(Request.read_angle())

    @both_apis
    def circle_angle(self) -> Exchanges[float]:
        """The angle within the turn, 0 to 359.99 ° (Read single circle angle command)."""
        return self._perform(Request.read_circle_angle())

    @both_apis
    def encoder(self) -> Exchanges[Encoder]:
        """What the encoder reads, in counts (Read encoder data command)."""
        return self._perform(Request.read_encoder())

    @both_apis
    def clear_errors(self) -> Exchanges[MotorStatus]:
        """Clears the errors whose cause is gone; gives what is left (Clear motor error flag command)."""
        return self._perform(Request.clear_errors())

    @both_apis
    def torque(self, amps: float) -> Exchanges[MotionStatus]:
        """Holds a torque current, within ±32 A (Torque current control command)."""
        return self._perform(Request.torque(amps))

    @both_apis
    def speed(self, dps: float) -> Exchanges[MotionStatus]:
        """Holds a speed, °/s (Speed control command)."""
        return self._perform(Request.speed(dps))

    @both_apis
    def move_to(self, degrees: float, max_speed: float | None = None) -> Exchanges[MotionStatus]:
        """Turns to an angle over all turns, °, no faster than ``max_speed``, °/s.

        ``max_speed`` is 1 at least and is rounded down to whole °/s. Position control commands 1
        and 2. Gives the motion as it was when the command came.
        """
        return self._perform(Request.move_to(degrees, max_speed))

    @both_apis
    def turn_to(
        self,
        degrees: float,
        max_speed: float | None = None,
        *,
        clockwise: bool = True,
        full_turn: bool = False,
        tolerance: float = 0.5,
    ) -> Exchanges[MotionStatus]:
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
            angle = yield self._perform(Request.read_circle_angle())
            request.check_full_turn(self._id, angle, tolerance)
        status: MotionStatus = yield self._perform(request)
        return status

    @both_apis
    def off(self) -> Exchanges[None]:
        """Switches the motor off; it forgets what it was doing (Motor off command)."""
        return self._perform(Request.off())

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor; it holds still and remembers what it was doing (Motor stop command)."""
        return self._perform(Request.stop())

    @both_apis
    def run(self) -> Exchanges[None]:
        """Resumes what :meth:`stop` stopped (Motor running command)."""
        return self._perform(Request.run())

    @both_apis
    def gains(self) -> Exchanges[Gains]:
        """The gains in RAM (Read PID parameter command).

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as bus:
        ...     motor = bus.motor(1)
        ...     motor.write_gains(motor.gains()._replace(speed_kp=50))
        ...     motor.gains().speed_kp
        50
        """
        return self._perform(Request.read_gains())

    @both_apis
    def write_gains(self, gains: Gains, *, rom: bool = False) -> Exchanges[None]:
        """Sets the gains until power-off, or with ``rom=True`` for good, which wears the ROM.

        Write PID to RAM, and to ROM, parameter command.
        """
        yield self._perform(Request.write_gains(*gains, rom=rom))

    @both_apis
    def acceleration(self) -> Exchanges[int]:
        """The acceleration limit, °/s²; 0 is none (0x33)."""
        return self._perform(Request.read_acceleration())

    @both_apis
    def write_acceleration(self, dps2: float) -> Exchanges[None]:
        """Sets the acceleration limit until power-off, °/s² (0x34)."""
        yield self._perform(Request.write_acceleration(dps2))

    @both_apis
    def write_encoder_offset(self, counts: int, *, rom: bool) -> Exchanges[int]:
        """Sets the encoder's zero, in counts, at once and for good, which wears the ROM: ``rom=True``.

        Gives the offset that the motor took (Write encoder offset command).
        """
        _wears(rom, "the encoder offset")
        return self._perform(Request.write_encoder_offset_to_rom(counts))

    @both_apis
    def write_zero(self, *, rom: bool) -> Exchanges[int]:
        """Makes the position the zero from the next power-on on, which wears the ROM: ``rom=True``.

        Gives the new offset, in counts (Write current position to ROM as motor zero position command).
        """
        _wears(rom, "the zero")
        return self._perform(Request.write_zero_to_rom())

    @both_apis
    def exchange_raw(self, data: bytes, *, rom: bool = False) -> Exchanges[bytes]:
        """One exchange with any eight bytes; ``rom=True`` allows those that wear the ROM."""
        return self._perform(Request.raw(data, rom=rom))

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._id} on {self._bus.port}>"


def _wears(rom: bool, what: str) -> None:
    """Asks for the word that allows a write to a motor's ROM."""
    if not rom:
        raise BadValue(f"{what} goes to the motor's ROM, which wears: say rom=True")
