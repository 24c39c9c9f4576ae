"""Clients and motors of the RMD protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, check_request, one
from motorlink._client import AnyClient
from motorlink._core import CanPort
from motorlink._rmd_table import MotionStatus, MotorCommands, Request, Status
from motorlink._sampling import AnySampling, Samples, by_motor, skips
from motorlink.errors import MotorlinkError

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound="RmdMotor[Any]")
PortT = TypeVar("PortT")
SamplingT = TypeVar("SamplingT", bound=AnySampling)
ClientT = TypeVar("ClientT", bound="RmdClient[Any, Any, Any]")


class ScanResult(NamedTuple):
    """What a scan found under a motor ID."""

    id: int
    #: ``motor`` of this protocol; ``foreign``: of a protocol that looks like it and is not driven;
    #: ``echo``: the request itself came back (option ``echo=1`` of an slcan port drops such).
    #: ``shared``: it answers another program or host, too.
    kind: str
    #: Of a motor.
    status: Status | None
    #: What a foreign motor speaks.
    dialect: str | None


class RmdClient(AnyClient, Generic[MotorT, PortT, SamplingT]):
    """The clients of both APIs."""

    _ENDS: ClassVar[dict[str, dict[str, bool]]] = {
        "stop": {"stop": True, "off": False},
        "off": {"stop": True, "off": True},
        "nothing": {"stop": False, "off": False},
    }
    _Motor: type[MotorT]
    _Sampling: type[SamplingT]
    # Each API's exchanges, with the arguments of the methods of the extension's ``RmdClient``.
    _exchange: Any
    _cycle: Any
    _torque4: Any
    _scan: Any
    _sample: Any
    _confirm: Any

    def __init__(self, core: Any, *, on_close: str = "stop", stop_on_signals: bool = True):
        super().__init__(core, on_close=on_close, stop_on_signals=stop_on_signals)

    @classmethod
    def _open(
        cls,
        port: PortT,
        *,
        timeout: float = _core.RMD_TIMEOUT,
        quarantine: float = _core.RMD_QUARANTINE,
        current_limit_amps: float | None = None,
        speed_limit_dps: float | None = None,
        angle_limit_degrees: float | None = None,
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ) -> Callable[[], Exchanges[Self]]:
        """Opens a CAN bus. Nothing is sent.

        For asyncio: ``async with open(...) as client``, or ``await open(...)``.

        ``port``
            ``socketcan:can0``, ``slcan:/dev/ttyACM0``, ``slcan:tcp:HOST:PORT``, ``sim:`` for simulated
            motors inside the process, a bus of python-can (:func:`motorlink.can.from_python_can`), or,
            not for asyncio, a bench of ``motorlink.sim``.
        ``timeout``
            How long to wait for a motor's reply, s.
        ``quarantine``
            How long after a timeout a late reply is awaited before the motor is asked again, s.
        ``current_limit_amps``, ``speed_limit_dps``, ``angle_limit_degrees``
            What no request to any motor may exceed in either direction, nor a raw frame; the angle is from
            zero. Rounded towards 0 to what a frame can say: 1.0 A allows 0.992 A, as a digit is
            0.016 A. With a speed limit a move needs ``max_speed_dps``. It does not bound the speed under a
            torque command, which is as fast as the load allows. The angle is that of ``set_position``:
            ``set_single_turn_position`` names none over all turns, and is not held back by it.
        ``on_close``
            What the end of ``with``, and ``close()``, do to motors that this client set moving: ``stop``
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
            quarantine=quarantine,
            current_limit_amps=current_limit_amps,
            speed_limit_dps=speed_limit_dps,
            angle_limit_degrees=angle_limit_degrees,
        )
        name = port if isinstance(port, CanPort) else cls._named(port)
        return cls._opening(
            functools.partial(cls._Core.open, name, options),
            on_close=on_close,
            stop_on_signals=stop_on_signals,
        )

    @property
    def moving(self) -> list[int]:
        """IDs of the motors that this client gave something to do and that did not stop since."""
        moving: list[int] = self._core.moving
        return moving

    def motor(self, id: int = 1) -> MotorT:
        """A motor of the bus, ID 1 to 32."""
        return self._Motor(self, id)

    @both_apis
    def exchange(self, motor: int, request: Request) -> Exchanges[Any]:
        """One exchange with a motor; gives what the reply says."""
        check_request(request, Request, "rmd.read_status()")
        return one(self._exchange(motor, request))

    @both_apis
    def confirm(self, motor: int = 1) -> Exchanges[None]:
        """Makes sure that a motor's replies so far went to their own requests, before you rely on what you
        read: one exchange more. A reply that nobody asked for is ``LinkError``: read again.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     angle = client.motor(1).multi_turn_angle()
        ...     client.confirm(1)
        """
        return one(self._confirm(motor))

    @both_apis
    def cycle(self, requests: Mapping[int, Request]) -> Exchanges[dict[int, Any]]:
        """Asks many motors at once; the exchanges overlap. Gives what each answered, by ID.

        >>> import motorlink
        >>> from motorlink import rmd
        >>> with rmd.open("sim:") as client:
        ...     answers = client.cycle({1: rmd.set_speed(100), 9: rmd.read_status()})
        >>> type(answers[1]).__name__, type(answers[9]).__name__
        ('MotionStatus', 'ReplyTimeoutError')

        What fails for one motor is its answer, an exception that is not raised; what fails for the
        line is raised.
        """
        for request in requests.values():
            check_request(request, Request, "rmd.read_status()")
        return one(self._cycle(list(requests.items())))

    @both_apis
    def set_torque4(
        self, iq_amps: Sequence[float], *, expect: Iterable[int] = (1, 2, 3, 4)
    ) -> Exchanges[dict[int, MotionStatus | MotorlinkError]]:
        """Torque currents for motors 1 to 4, in this order, in one frame (chapter 4, 0x280).

        Gives what each of the motors in ``expect`` answered; a motor that fails has an exception
        there, which is not raised. Raises ``InvalidValueError`` beyond ±32 A or a limit; nothing is sent then.
        """
        return one(self._torque4(list(iq_amps), list(expect)))

    @both_apis
    def scan(self, ids: Iterable[int] = range(1, 33)) -> Exchanges[list[ScanResult]]:
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
        >>> with motorlink.rmd.open("sim:") as client:
        ...     data = client.sample({1: ["iq_amps", "speed_dps"], 2: ["iq_amps"]}, rate=100, seconds=0.1)
        >>> data.dtype.names
        ('t', 'iq_amps_1', 'speed_dps_1', 'iq_amps_2')

        What there is: :data:`QUANTITIES`. A list of names samples ``motor``, and its fields have no
        number behind them. ``t`` is the moment, s since the first instant, at which the row's first
        requests left. Motors are asked in the same cycles; quantities of different commands take one
        cycle each. Instants do not drift; one that the bus was too slow for is missing, and no row is
        ever made up.

        A row that fails raises, with what was sampled before in the exception's ``samples``; with
        ``on_error="skip"`` a motor that fails costs the row only. Ctrl-C ends it, with ``samples`` too; so
        does the cancellation of a task. Exchanges of other tasks have their turns in between.
        """
        sampling: Any = self._sampling(quantities, rate, seconds, motor, raw, on_error)
        return one(sampling._array())

    def samples(
        self,
        quantities: Mapping[int, Sequence[str]] | Sequence[str],
        *,
        rate: float,
        seconds: float | None = None,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> SamplingT:
        """Reads what motors tell ``rate`` times a second, a row each time that the loop asks for one.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     for row in client.samples({1: ["speed_dps"], 2: ["speed_dps"]}, rate=100):
        ...         print(row.t, row["speed_dps_1"], row["speed_dps_2"])
        ...         break
        0.0 0.0 0.0

        For asyncio: ``async for row in client.samples(...)``. Arguments, names, units and instants are those
        of :meth:`sample`; without ``seconds`` there is no end. A row is a ``dict``, a
        :class:`motorlink.Sample`. No thread reads ahead: a row is read when the loop asks for it, so that
        its values are new. A loop that is slower than ``rate`` gets fewer rows; ``row.skipped`` is the number
        of instants before the row that have none.

        ``break`` leaves motors as they are; the end of ``with`` stops those that this client started. So
        does Ctrl-C, and an error, which is raised after the rows that were read before. After an error
        there are no more rows: call ``samples`` again.
        """
        return self._sampling(quantities, rate, seconds, motor, raw, on_error)

    def _sampling(
        self,
        quantities: Mapping[int, Sequence[str]] | Sequence[str],
        rate: float,
        seconds: float | None,
        motor: int,
        raw: bool,
        on_error: str,
    ) -> SamplingT:
        skip = skips(on_error)
        motors, names = by_motor(quantities, motor, str)
        rows = _core.RmdSampling(motors, rate, seconds, raw)
        take = functools.partial(self._sample, rows, skip)
        return self._Sampling(self, take, names, raw=raw, release=lambda: None)

    def __repr__(self) -> str:
        return self._text()


class RmdMotor(MotorCommands, Generic[ClientT]):
    """The motors of both APIs."""

    __slots__ = ("__weakref__", "_client", "_id")

    def __init__(self, client: ClientT, id: int):
        self._client = client
        self._id = _core.rmd_motor(id)

    @property
    def client(self) -> ClientT:
        """The client that it is of."""
        return self._client

    @property
    def id(self) -> int:
        """The motor's ID."""
        return self._id

    def _exchange(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._client._exchange(self._id, request)
        return given

    def set_limits(
        self,
        *,
        current_limit_amps: float | None = None,
        speed_limit_dps: float | None = None,
        angle_limit_degrees: float | None = None,
    ) -> None:
        """What this motor may be told from now on; ``None`` is no limit.

        All three at once, in place of those of :func:`open`, and rounded as they are.
        """
        self._client._core.set_limits(
            self._id, current_limit_amps, speed_limit_dps, angle_limit_degrees
        )

    @both_apis
    def set_position(
        self, angle_degrees: float, max_speed_dps: float | None = None
    ) -> Exchanges[MotionStatus]:
        """Turns to an angle over all turns, no faster than ``max_speed_dps``.

        ``max_speed_dps`` is 1 at least and is rounded down to whole °/s. Position control commands 1
        and 2. Gives the motion as it was when the command came.
        """
        if max_speed_dps is None:
            return self._exchange(Request.set_position(angle_degrees))
        return self._exchange(
            Request.set_position_limited(angle_degrees=angle_degrees, max_speed_dps=max_speed_dps)
        )

    @both_apis
    def set_single_turn_position(
        self,
        angle_degrees: float,
        max_speed_dps: float | None = None,
        *,
        direction: str = "clockwise",
        full_turn: bool = False,
        tolerance_degrees: float = _core.RMD_FULL_TURN_TOLERANCE,
    ) -> Exchanges[MotionStatus]:
        """Turns to an angle within the turn, 0 to 359.99 °, ``clockwise`` or ``counterclockwise``.

        No faster than ``max_speed_dps``, 1 at least, rounded down. Position control commands 3 and 4.

        The motor is asked for its angle first. At its target, or up to ``tolerance_degrees`` past it,
        the move could be nearly a full turn: ``FullTurnError`` is raised, and the motor is not moved. It
        is not asked with ``full_turn=True``.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:     # the motor is at 0 °
        ...     client.motor(1).set_single_turn_position(0)
        Traceback (most recent call last):
        motorlink.errors.FullTurnError: motor 1 is at 0.00°, 0.00° past 0.00° clockwise: ...
        """
        if max_speed_dps is None:
            request = Request.set_single_turn_position(
                angle_degrees=angle_degrees, direction=direction
            )
        else:
            request = Request.set_single_turn_position_limited(
                angle_degrees=angle_degrees, direction=direction, max_speed_dps=max_speed_dps
            )
        _core.rmd_full_turn_tolerance(tolerance_degrees)
        if not full_turn:
            angle = yield self._exchange(Request.read_single_turn_angle())
            request.check_full_turn(self._id, angle, tolerance_degrees)
        status: MotionStatus = yield self._exchange(request)
        return status

    @both_apis
    def raw(self, data: bytes, *, rom: bool = False) -> Exchanges[bytes]:
        """One exchange with any eight bytes; ``rom=True`` allows those that wear the ROM."""
        return self._exchange(Request.raw(data, rom=rom))

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._id} on {self._client.port}>"
