"""Clients and motors of the RMD protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, check_request, one
from motorlink._arrival import arrived
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
    """The result of a scan for one motor ID."""

    id: int
    #: ``motor``: a motor of this protocol. ``foreign``: a motor of a similar protocol, which is not
    #: supported. ``echo``: the request came back (the option ``echo=1`` of an slcan port removes it).
    #: ``shared``: the motor replies to another program or host, too.
    kind: str
    #: The status of a motor, otherwise ``None``.
    status: Status | None
    #: The protocol of a foreign motor, otherwise ``None``.
    dialect: str | None


class RmdClient(AnyClient, Generic[MotorT, PortT, SamplingT]):
    """What the clients of both APIs have in common."""

    _ENDS: ClassVar[dict[str, dict[str, bool]]] = {
        "stop": {"stop": True, "off": False},
        "off": {"stop": True, "off": True},
        "nothing": {"stop": False, "off": False},
    }
    _Motor: type[MotorT]
    _Sampling: type[SamplingT]
    # The exchanges of each API. Arguments are those of ``RmdClient`` of the extension.
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
        """Opens a CAN bus. Sends nothing.

        For asyncio: ``async with open(...) as client``, or ``await open(...)``.

        ``port``
            ``socketcan:can0``, ``slcan:/dev/ttyACM0``, ``slcan:tcp:HOST:PORT``, ``sim:`` for simulated motors
            inside the process, or a bus of python-can (:func:`motorlink.can.from_python_can`). The blocking
            API also takes a bench of ``motorlink.sim``.
        ``timeout``
            Time to wait for a motor's reply, s.
        ``quarantine``
            Time after a timeout in which the motor gets no request, s: a late reply can still arrive.
        ``current_limit_amps``, ``speed_limit_dps``, ``angle_limit_degrees``
            The most that a request to any motor may ask for, in both directions. They also hold for raw
            frames. The angle limit counts from zero. They are rounded towards 0 to a value that a frame can
            carry: 1.0 A becomes 0.992 A, as a digit is 0.016 A. Torque currents are rounded in the same way, so
            a current equal to the limit is allowed.
            With a speed limit, a move needs ``max_speed_dps``. The limit does not hold under a torque command,
            where the load decides the speed. The angle limit holds for ``set_position``. It does not hold for
            ``set_single_turn_position``, whose angle is within the turn.
        ``on_close``
            What the end of ``with`` and ``close()`` do with the motors that this client moved. ``stop``: they
            hold still (0x81). ``off``: they are switched off (0x80). ``nothing``: they continue.
        ``stop_on_signals``
            SIGTERM and SIGHUP stop motors as ``close()`` does. Then they end the program as usual. The
            handlers are installed if this is called in the main thread, and only over the default action.
            The last ``close()`` removes them. ``False``: no handler is installed. In asyncio the event loop is
            blocked while motors are stopped.

        Raises ``PortError`` if the port cannot be opened, ``InvalidValueError`` for a wrong argument.
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
        """IDs of the motors that this client commanded and that did not stop since."""
        moving: list[int] = self._core.moving
        return moving

    def motor(self, id: int = 1) -> MotorT:
        """A motor of the bus, ID 1 to 32.

        Raises ``InvalidValueError`` for another ID.
        """
        return self._Motor(self, id)

    @both_apis
    def exchange(self, motor: int, request: Request) -> Exchanges[Any]:
        """Sends a request to a motor. Returns the value of the reply.

        >>> import motorlink
        >>> from motorlink import rmd
        >>> with rmd.open("sim:") as client:
        ...     client.exchange(1, rmd.read_single_turn_angle())
        0.0
        """
        check_request(request, Request, "rmd.read_status()")
        return one(self._exchange(motor, request))

    @both_apis
    def confirm(self, motor: int = 1) -> Exchanges[None]:
        """Checks with one more exchange that no late reply of a motor was taken for another reply. Call it
        before you rely on values that you read.

        Raises ``LinkError`` if there was a reply without a request: read again.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     angle = client.motor(1).multi_turn_angle()
        ...     client.confirm(1)
        """
        return one(self._confirm(motor))

    @both_apis
    def cycle(self, requests: Mapping[int, Request]) -> Exchanges[dict[int, Any]]:
        """Sends a request to each of several motors at once. Returns the replies by motor ID.

        >>> import motorlink
        >>> from motorlink import rmd
        >>> with rmd.open("sim:") as client:
        ...     answers = client.cycle({1: rmd.set_speed(100), 9: rmd.read_status()})
        >>> type(answers[1]).__name__, type(answers[9]).__name__
        ('MotionStatus', 'ReplyTimeoutError')

        If one motor fails, its value is the exception, which is not raised. An error of the line is raised.
        """
        for request in requests.values():
            check_request(request, Request, "rmd.read_status()")
        return one(self._cycle(list(requests.items())))

    @both_apis
    def set_torque4(
        self, iq_amps: Sequence[float], *, expect: Iterable[int] = (1, 2, 3, 4)
    ) -> Exchanges[dict[int, MotionStatus | MotorlinkError]]:
        """Sends torque currents to motors 1 to 4 in one frame (0x280, chapter 4). Returns the replies by ID.

        ``iq_amps`` has four values. ``expect`` has the motors that must reply. If a motor fails, its value is
        the exception, which is not raised.

        Raises ``InvalidValueError`` beyond ±32 A or a limit; then nothing is sent.
        """
        return one(self._torque4(list(iq_amps), list(expect)))

    @both_apis
    def scan(self, ids: Iterable[int] = range(1, 33)) -> Exchanges[list[ScanResult]]:
        """Asks each ID for its status. Returns the replies in the order of arrival; for asyncio in the order of
        the IDs.
        """
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
        """Reads values of motors ``rate`` times a second for ``seconds``. Returns a NumPy structured array.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     data = client.sample({1: ["iq_amps", "speed_dps"], 2: ["iq_amps"]}, rate=100, seconds=0.1)
        >>> data.dtype.names
        ('t', 'iq_amps_1', 'speed_dps_1', 'iq_amps_2')

        :data:`QUANTITIES` lists the names. A list of names samples ``motor``; its fields have no motor number.
        ``t`` is the time from the first instant to the first requests of the row, s. The other fields are in
        their units, or in digits with ``raw=True``. All motors are asked in the same cycle. Values of different
        commands need one cycle each.

        Instants do not drift. If the bus is too slow for an instant, its row is missing: look at ``t``. No row
        is invented.

        A failed row raises. The exception has the rows that were read before in ``samples``. With
        ``on_error="skip"`` a row without a motor's reply is left out. Ctrl-C and the cancellation of a task
        end the sampling, also with ``samples``. In asyncio, exchanges of other tasks run between the rows.
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
        """Reads values of motors ``rate`` times a second and returns an iterator of rows.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     for row in client.samples({1: ["speed_dps"], 2: ["speed_dps"]}, rate=100):
        ...         print(row.t, row["speed_dps_1"], row["speed_dps_2"])
        ...         break
        0.0 0.0 0.0

        For asyncio: ``async for row in client.samples(...)``. Arguments, names, units and instants are those
        of :meth:`sample`. Without ``seconds`` the iterator has no end. A row is a
        :class:`motorlink.Sample`, a ``dict``.

        A row is read when the loop asks for it, so its values are new. If the loop is slower than ``rate``, it
        gets fewer rows. ``row.skipped`` is the number of instants without a row before this row.

        ``break`` ends the sampling and does not stop a motor. An error or Ctrl-C is raised in the loop, after
        the rows that were read before. The end of ``with`` then stops the motors that this client moved.
        After an error the iterator has no more rows: call ``samples`` again.
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
    """What the motors of both APIs have in common."""

    __slots__ = ("__weakref__", "_client", "_id")

    def __init__(self, client: ClientT, id: int):
        self._client = client
        self._id = _core.rmd_motor(id)

    @property
    def client(self) -> ClientT:
        """The client of this motor."""
        return self._client

    @property
    def id(self) -> int:
        """The motor's ID."""
        return self._id

    def _exchange(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._client._exchange(self._id, request)
        return given

    def _arrived(self, watch: _core.RmdArrival) -> Exchanges[MotionStatus]:
        return arrived(
            self._client, watch, self._exchange, lambda: self._client._confirm(self._id)
        )

    def set_limits(
        self,
        *,
        current_limit_amps: float | None = None,
        speed_limit_dps: float | None = None,
        angle_limit_degrees: float | None = None,
    ) -> None:
        """Sets the limits of this motor. Sends nothing. ``None`` removes a limit.

        They replace all three limits of :func:`open` for this motor. They are rounded in the same way.
        """
        self._client._core.set_limits(
            self._id, current_limit_amps, speed_limit_dps, angle_limit_degrees
        )

    @both_apis
    def set_position(
        self,
        angle_degrees: float,
        max_speed_dps: float | None = None,
        *,
        wait: bool = False,
        arrival_tolerance_degrees: float = _core.RMD_ARRIVAL_TOLERANCE,
        timeout: float | None = None,
    ) -> Exchanges[MotionStatus]:
        """Turns to an angle over all turns, ° (0xA3; with ``max_speed_dps`` 0xA4). Returns the motion before it.

        ``max_speed_dps`` is at least 1 and is rounded down to whole °/s.

        ``wait=True`` returns when the motor has arrived: it is at most ``arrival_tolerance_degrees`` from
        the target and its angle does not change for 0.25 s. The result is the motion then. Otherwise
        ``NotArrivedError`` is raised, and the motor still has its command. ``timeout``, s, is by default
        twice the time of the distance at ``max_speed_dps`` and 10 s; 60 s without ``max_speed_dps``.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     status = client.motor(1).set_position(90, max_speed_dps=500, wait=True)
        """
        if max_speed_dps is None:
            request = Request.set_position(angle_degrees)
        else:
            request = Request.set_position_limited(
                angle_degrees=angle_degrees, max_speed_dps=max_speed_dps
            )
        status: MotionStatus
        if not wait:
            status = yield self._exchange(request)
            return status
        watch = _core.RmdArrival(self._id, request, arrival_tolerance_degrees, timeout)
        yield self._exchange(request)
        status = yield from self._arrived(watch)
        return status

    @both_apis
    def set_single_turn_position(
        self,
        angle_degrees: float,
        max_speed_dps: float | None = None,
        *,
        direction: str = "clockwise",
        full_turn: bool = False,
        tolerance_degrees: float = _core.RMD_FULL_TURN_TOLERANCE,
        wait: bool = False,
        arrival_tolerance_degrees: float = _core.RMD_ARRIVAL_TOLERANCE,
        timeout: float | None = None,
    ) -> Exchanges[MotionStatus]:
        """Turns to an angle within the turn (0xA5; with ``max_speed_dps`` 0xA6). Returns the motion before it.

        ``angle_degrees`` is 0 to 359.99. ``direction`` is ``clockwise`` or ``counterclockwise``.
        ``max_speed_dps`` is at least 1 and is rounded down to whole °/s.

        The angle is read first. If the motor is at the target, or at most ``tolerance_degrees`` past it, the
        move could be nearly a full turn. Then ``FullTurnError`` is raised and the motor does not move.
        ``full_turn=True`` sends the move without this check.

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
        watch = _core.RmdArrival(self._id, request, arrival_tolerance_degrees, timeout)
        if not full_turn:
            angle = yield self._exchange(Request.read_single_turn_angle())
            request.check_full_turn(self._id, angle, tolerance_degrees)
        status: MotionStatus = yield self._exchange(request)
        if wait:
            status = yield from self._arrived(watch)
        return status

    @both_apis
    def raw(self, data: bytes, *, rom: bool = False) -> Exchanges[bytes]:
        """Sends any eight bytes. Returns the eight bytes of the reply.

        Raises ``InvalidValueError`` for bytes that write to the ROM, which wears. ``rom=True`` allows them.
        """
        return self._exchange(Request.raw(data, rom=rom))

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._id} on {self._client.port}>"
