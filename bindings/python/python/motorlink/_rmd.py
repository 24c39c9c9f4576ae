"""Clients of the RMD protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, check_request, one
from motorlink._client import AnyClient
from motorlink._core import CanPort
from motorlink._rmd_motor import RmdMotor
from motorlink._rmd_table import MotionStatus, Request, Status
from motorlink._sampling import AnySampling, Samples, by_motor, skips
from motorlink.errors import MotorlinkError

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound=RmdMotor[Any])
PortT = TypeVar("PortT")
SamplingT = TypeVar("SamplingT", bound=AnySampling)


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
        gear_ratio: float | Mapping[int, float] | None = None,
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ) -> Callable[[], Exchanges[Self]]:
        """Opens a CAN bus. Sends nothing.

        For asyncio: ``async with open(...) as client``, or ``await open(...)``.

        ``port``
            ``socketcan:can0``, ``slcan:/dev/ttyACM0``, ``slcan:tcp:HOST:PORT``, ``share:PATH/rmd0`` for a line
            of ``motorlink share``, ``sim:`` for simulated motors inside the process, or a bus of python-can (:func:`motorlink.can.from_python_can`). The blocking
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
            where the load decides the speed. The angle limit is checked for ``set_position`` only. Speed and
            torque commands can turn the motor beyond it. It does not hold for ``set_single_turn_position``,
            whose angle is within the turn.
        ``gear_ratio``
            Turns of the motor shaft for one turn of the output shaft: 6 for a gear of 6:1. All angles, speeds
            and accelerations of this client are then those of the output shaft: arguments, replies, samples
            and limits. A dict has the ratio by ID; its other motors have none. Requests for ``exchange`` and
            ``cycle`` need the same ``gear_ratio``. The motor shaft is still that of raw frames, of encoder
            counts, and of angles in messages of errors. ``set_single_turn_position`` is refused.
        ``on_close``
            What the end of ``with`` and ``close()`` do with the motors that this client moved. ``stop``: they
            hold still (0x81). ``off``: they are switched off (0x80). ``nothing``: they continue. On a share or
            a node this also holds if the program is killed, and motors that another program has moved since
            are left as they are.
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
            gear_ratio=gear_ratio,
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
        self._core.check_gear(motor, request)
        return one(self._exchange(motor, request))

    @both_apis
    def confirm(self, motor: int = 1) -> Exchanges[None]:
        """Checks with one more exchange that no late reply of a motor was taken for another reply. Call it
        before you rely on values that you read.

        Raises ``LinkError`` if there was a reply without a request: read again. After a confirmation or a
        failure of another thread or task, or of a sampling, it says nothing about values that were read before
        that.

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

        Raises ``InvalidValueError`` if a request is beyond a limit; then nothing is sent to any motor.
        """
        if not isinstance(requests, Mapping):
            raise TypeError(
                f"give the requests by motor ID, such as `{{1: rmd.read_status()}}`, not {requests!r}"
            )
        for motor, request in requests.items():
            check_request(request, Request, "rmd.read_status()")
            self._core.check_gear(motor, request)
        return one(self._cycle(list(requests.items())))

    @both_apis
    def set_torque4(
        self, iq_amps: Sequence[float], *, expect: Iterable[int] = (1, 2, 3, 4)
    ) -> Exchanges[dict[int, MotionStatus | MotorlinkError]]:
        """Sends torque currents to motors 1 to 4 in one frame (0x280, chapter 4). Returns the replies by ID.

        ``iq_amps`` has four values. ``expect`` has the motors that must reply. If a motor fails, its value is
        the exception, which is not raised. The frame reaches the other motors, too. They are not in
        :attr:`moving`. The end of ``with`` stops them, and does not raise if they do not answer.

        Raises ``InvalidValueError`` beyond ±32 A or a limit; then nothing is sent.
        """
        if isinstance(iq_amps, Mapping):
            raise TypeError("give the currents as a list: motor 1 first, 0 for no torque")
        return one(self._torque4(list(iq_amps), list(expect)))

    @both_apis
    def scan(self, ids: Iterable[int] = range(1, 33)) -> Exchanges[list[ScanResult]]:
        """Asks each ID for its status. Returns the replies in the order of arrival; for asyncio in the order of
        the IDs.
        """
        if isinstance(ids, int):
            raise TypeError(f"give the IDs as a list: [{ids}]")
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
        their units, or in digits with ``raw=True``. All motors are asked at the same instants. One exchange
        reads all values of a reply.

        Instants are whole microseconds apart and do not drift. If the bus is too slow for an instant, its row
        is missing: look at ``t``. No row is invented.

        Each value is confirmed to belong to its request. If another thread or task loses a motor's reply, the
        rows since the last confirmation are left out. If no row is left for 1 s, it raises.

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

        A row is read when the loop asks for it, so its values are new. They are confirmed before the loop gets
        them, at least every 10 ms: at a higher rate some rows come together. If the loop is slower than
        ``rate``, it gets fewer rows. ``row.skipped`` is the number of instants without a row before this row.

        ``break`` ends the sampling and does not stop a motor. An error or Ctrl-C is raised in the loop, after
        the rows that were read before. The end of ``with`` then stops motors, as ``on_close`` says.
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
        wanted, names = by_motor(quantities, motor, str)
        motors = [(id, some, self._core.gear_ratio(id)) for id, some in wanted]
        rows = self._core.sampling(motors, rate, seconds, raw)
        take = functools.partial(self._sample, rows, skip)
        return self._Sampling(self, take, names, raw=raw, release=lambda: None)

    def __repr__(self) -> str:
        return self._text()
