"""Clients of ST's serial Motor Control Protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, check_request, one
from motorlink._client import AnyClient
from motorlink._core import StRequest as Request
from motorlink._sampling import AnySampling, Samples, by_motor, skips
from motorlink._segments import Segments
from motorlink._st_motor import StMotor
from motorlink._values import BoardInfo, FirmwareVersion

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound=StMotor[Any])
PortT = TypeVar("PortT")
SamplingT = TypeVar("SamplingT", bound=AnySampling)


class StClient(AnyClient, Generic[MotorT, PortT, SamplingT]):
    """What the clients of both APIs have in common."""

    _ENDS: ClassVar[dict[str, dict[str, bool]]] = {"stop": {"stop": True}, "nothing": {"stop": False}}
    _Motor: type[MotorT]
    _Sampling: type[SamplingT]
    # The exchanges of each API. Arguments are those of ``StClient`` of the extension.
    _exchange: Any
    _exchange_raw: Any
    _set_verified: Any
    _sample: Any
    _confirm: Any

    def __init__(
        self,
        core: Any,
        *,
        profile: str = "spec",
        full_scale_amps: float | None = None,
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ):
        super().__init__(core, on_close=on_close, stop_on_signals=stop_on_signals)
        self._profile = profile
        self._full_scale_amps = full_scale_amps
        self._segments = Segments()

    @classmethod
    def _open(
        cls,
        port: PortT,
        *,
        profile: str = "spec",
        timeout: float = _core.ST_TIMEOUT,
        speed_limit_rpm: float | None = None,
        current_limit: float | None = None,
        full_scale_amps: float | None = None,
        recovery: str = "drain",
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ) -> Callable[[], Exchanges[Self]]:
        """Opens the serial line of a drive. Sends nothing.

        For asyncio: ``async with open(...) as client``, or ``await open(...)``.

        ``port``
            ``/dev/ttyACM0``, ``serial:/dev/ttyUSB0?baud=115200``, ``tcp:HOST:PORT``, ``unix:PATH``, the path
            of a pty, ``share:PATH/st0`` for a line of ``motorlink share``, or ``sim:`` for a simulated drive
            inside the process. The blocking API also takes a bench of ``motorlink.sim``.
        ``profile``
            ``spec``: the drive follows the document. ``mcsdk-5.4``: the drive follows the firmware that ST
            ships.
        ``timeout``
            Time to wait for a reply, s. The document has 1 s (4.1).
        ``speed_limit_rpm``, ``current_limit``
            The most that a request may ask for, in both directions. They also hold for register writes and
            raw frames. The current is in A with ``full_scale_amps``, otherwise in digits. They are rounded
            towards 0 to a value that a frame can carry. Currents in A are rounded in the same way, so a current
            equal to the limit is allowed.
            With a speed limit, a motor starts only after a ``set_ramp`` within the limit, and
            ``set_position`` is refused. After a torque command, a write of CONTROL_MODE, a reset of the
            drive, or a lost line or port, call ``set_ramp`` again. The limit does not hold under a torque
            command (``set_current_reference``, ``set_torque_ramp``), where the load decides the speed. It does
            not hold for the drive's rev-up, alignment and motor profiler.
        ``full_scale_amps``
            The current of digit 32767, A. A motor can have its own: :meth:`Client.motor`.
        ``recovery``
            How the line is resynchronised before the next exchange. ``drain``: wait for silence. ``pad``: send
            padding first, for 5.x drives that wait for the rest of a cut-off frame. ``none``: do nothing.
        ``on_close``
            ``stop``: the end of ``with`` and ``close()`` stop the motors that this client started, or whose
            motion it changed. ``nothing``: the motors continue. On a share or a node this also holds if the
            program is killed, and motors that another program has moved since are left as they are.
        ``stop_on_signals``
            SIGTERM and SIGHUP stop motors as ``close()`` does. Then they end the program as usual. The
            handlers are installed if this is called in the main thread, and only over the default action.
            The last ``close()`` removes them. ``False``: no handler is installed. In asyncio the event loop is
            blocked while motors are stopped.

        Raises ``PortError`` if the port cannot be opened, ``InvalidValueError`` for a wrong argument.
        """
        options = _core.StOptions(
            profile=profile,
            timeout=timeout,
            recovery=recovery,
            speed_limit_rpm=speed_limit_rpm,
            current_limit=current_limit,
            full_scale_amps=full_scale_amps,
        )
        return cls._opening(
            functools.partial(cls._Core.open, cls._named(port), options),
            profile=profile,
            full_scale_amps=full_scale_amps,
            on_close=on_close,
            stop_on_signals=stop_on_signals,
        )

    @property
    def profile(self) -> str:
        """The profile: ``spec`` or ``mcsdk-5.4``."""
        return self._profile

    @property
    def moving(self) -> list[int]:
        """Numbers of the motors that this client started and did not stop."""
        moving: list[int] = self._core.moving
        return moving

    def motor(self, number: int = 1, *, full_scale_amps: float | None = None) -> MotorT:
        """A motor of the drive, 1 to 7.

        ``full_scale_amps`` is the current of digit 32767, A, if it differs from that of :func:`open`.

        Raises ``InvalidValueError`` for another number.
        """
        if full_scale_amps is None:
            full_scale_amps = self._full_scale_amps
        return self._Motor(self, number, full_scale_amps)

    @both_apis
    def board_info(self) -> Exchanges[BoardInfo]:
        """Reads version and name of the SDK (0x06, 4.7)."""
        return one(self._exchange(0, Request.get_board_info()))

    @both_apis
    def firmware_version(self) -> Exchanges[FirmwareVersion]:
        """Reads name and version of the firmware (0x0C, 4.12)."""
        return one(self._exchange(0, Request.get_firmware_version()))

    @both_apis
    def exchange(self, motor: int, request: Request) -> Exchanges[Any]:
        """Sends a request to a motor. Returns the value of the reply.

        >>> import motorlink
        >>> from motorlink.st import Request
        >>> with motorlink.st.open("sim:") as client:
        ...     client.exchange(1, Request.get_register("BUS_VOLTAGE"))
        325
        """
        check_request(request, Request, "Request.status()")
        return one(self._exchange(motor, request))

    @both_apis
    def confirm(self) -> Exchanges[None]:
        """Checks with one more exchange that no late or repeated reply was taken for another reply. Call it
        before you rely on values that you read.

        Raises ``LinkError`` if a reply came twice or late: read again. After a confirmation or a failure of
        another thread or task, or of a sampling, it says nothing about values that were read before that.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     volts = client.motor(1).get("BUS_VOLTAGE")
        ...     client.confirm()
        """
        return one(self._confirm())

    @both_apis
    def raw(self, code: int, payload: bytes = b"", *, motor: int = 0) -> Exchanges[bytes]:
        """Sends any frame code, 0 to 0x1F, with any payload. Returns the payload of the reply.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.raw(0x02, b"\\x1e", motor=1)       # GET_REG, SPEED_MEAS
        b'\\x00\\x00\\x00\\x00'
        """
        return one(self._exchange_raw(motor, code, payload))

    @both_apis
    def sample(
        self,
        registers: Sequence[str | int] | Mapping[int, Sequence[str | int]],
        *,
        rate: float,
        seconds: float,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> Exchanges[Samples]:
        """Reads registers ``rate`` times a second for ``seconds``. Returns a NumPy structured array.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     data = client.sample(["SPEED_MEAS", "BUS_VOLTAGE"], rate=100, seconds=0.1)
        >>> data.dtype.names
        ('t', 'SPEED_MEAS', 'BUS_VOLTAGE')

        ``t`` is the time from the first instant to the first request of the row, s. The other fields are in
        their units, or in digits with ``raw=True``. Instants are whole microseconds apart and do not drift. If
        the line is too slow for an instant, its row is missing: look at ``t``. No row is invented.

        A list samples ``motor``. ``{1: ["SPEED_MEAS"], 2: ["SPEED_MEAS"]}`` samples several motors; the fields
        are ``SPEED_MEAS_1`` and ``SPEED_MEAS_2``.

        With profile ``spec`` one exchange reads all registers of a motor at one moment, through a data
        segment. Each motor needs one. The client takes free segments from number 3 down. It does not take
        those that ``configure_segment`` or another sampling uses. Without a free segment it reads the
        registers one after the other.

        Each value is confirmed to belong to its request. If another thread or task loses the line, the rows
        since the last confirmation are left out. If no row is left for 1 s, it raises.

        A failed row raises. The exception has the rows that were read before in ``samples``. With
        ``on_error="skip"`` a row that the line lost is left out. Ctrl-C and the cancellation of a task end
        the sampling, also with ``samples``. In asyncio, exchanges of other tasks run between the rows.
        """
        sampling: Any = self._sampling(registers, rate, seconds, motor, raw, on_error)
        return one(sampling._array())

    def samples(
        self,
        registers: Sequence[str | int] | Mapping[int, Sequence[str | int]],
        *,
        rate: float,
        seconds: float | None = None,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> SamplingT:
        """Reads registers ``rate`` times a second and returns an iterator of rows.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     for row in client.samples(["SPEED_MEAS", "BUS_VOLTAGE"], rate=100):
        ...         print(row.t, row["SPEED_MEAS"], row["BUS_VOLTAGE"])
        ...         break
        0.0 0.0 325.0

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
        return self._sampling(registers, rate, seconds, motor, raw, on_error)

    def _sampling(
        self,
        registers: Sequence[str | int] | Mapping[int, Sequence[str | int]],
        rate: float,
        seconds: float | None,
        motor: int,
        raw: bool,
        on_error: str,
    ) -> SamplingT:
        skip = skips(on_error)
        wanted, names = by_motor(registers, motor, _core.st_register_name)
        motors = [(number, some, self._full_scale_amps) for number, some in wanted]
        segments, release = self._segments.for_sampling(len(motors))
        try:
            rows = self._core.sampling(self._profile, motors, segments, rate, seconds, raw)
            take = functools.partial(self._sample, rows, skip)
            return self._Sampling(self, take, names, raw=raw, release=release)
        except BaseException:
            release()
            raise

    def __repr__(self) -> str:
        return self._text(f", profile {self._profile}")
