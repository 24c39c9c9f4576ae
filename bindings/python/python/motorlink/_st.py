"""Clients and motors of ST's serial Motor Control Protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, check_request, one
from motorlink._arrival import moved, needs_wait
from motorlink._client import AnyClient
from motorlink._core import StRequest as Request
from motorlink._sampling import AnySampling, Samples, by_motor, skips
from motorlink._segments import Segments
from motorlink._values import BoardInfo, ControlMode, FirmwareVersion, Flags, RevupPhase, Status
from motorlink.errors import InvalidValueError

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound="StMotor[Any]")
PortT = TypeVar("PortT")
SamplingT = TypeVar("SamplingT", bound=AnySampling)
ClientT = TypeVar("ClientT", bound="StClient[Any, Any, Any]")


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
            of a pty, or ``sim:`` for a simulated drive inside the process. The blocking API also takes a
            bench of ``motorlink.sim``.
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
            ``stop``: the end of ``with`` and ``close()`` stop the motors that this client started.
            ``nothing``: the motors continue.
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

        Raises ``LinkError`` if a reply came twice or late: read again.

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
        their units, or in digits with ``raw=True``. Instants do not drift. If the line is too slow for an
        instant, its row is missing: look at ``t``. No row is invented.

        A list samples ``motor``. ``{1: ["SPEED_MEAS"], 2: ["SPEED_MEAS"]}`` samples several motors; the fields
        are ``SPEED_MEAS_1`` and ``SPEED_MEAS_2``.

        With profile ``spec`` one exchange reads all registers of a motor at one moment, through a data
        segment. Each motor needs one. The client takes free segments from number 3 down. It does not take
        those that ``configure_segment`` or another sampling uses. Without a free segment it reads the
        registers one after the other.

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

        A row is read when the loop asks for it, so its values are new. If the loop is slower than ``rate``, it
        gets fewer rows. ``row.skipped`` is the number of instants without a row before this row.

        ``break`` ends the sampling and does not stop a motor. An error or Ctrl-C is raised in the loop, after
        the rows that were read before. The end of ``with`` then stops the motors that this client started.
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
            rows = _core.StSampling(self._profile, motors, segments, rate, seconds, raw)
            take = functools.partial(self._sample, rows, skip)
            return self._Sampling(self, take, names, raw=raw, release=release)
        except BaseException:
            release()
            raise

    def __repr__(self) -> str:
        return self._text(f", profile {self._profile}")


class StMotor(Generic[ClientT]):
    """What the motors of both APIs have in common."""

    __slots__ = ("__weakref__", "_client", "_full_scale_amps", "_number", "_reads")

    def __init__(self, client: ClientT, number: int, full_scale_amps: float | None):
        self._client = client
        self._number = _core.st_motor(number)
        self._full_scale_amps = full_scale_amps
        self._reads: dict[tuple[str | int, bool], Request] = {}

    @property
    def client(self) -> ClientT:
        """The client of this motor."""
        return self._client

    @property
    def number(self) -> int:
        """The motor's number."""
        return self._number

    @property
    def full_scale_amps(self) -> float | None:
        """The current of digit 32767, A. ``None``: currents are in digits."""
        return self._full_scale_amps

    def _exchange(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._client._exchange(self._number, request)
        return given

    @both_apis
    def get(self, register: str | int, *, raw: bool = False) -> Exchanges[float]:
        """Reads a register (0x02, 4.5) in its unit, or in digits with ``raw=True``.

        Returns an integer if one digit is one unit, otherwise a float. States and flags are numbers here:
        :meth:`status` and :meth:`flags` return them as text.

        Raises ``RefusedError`` if the drive cannot read it, ``UnknownRegisterError`` for an unknown name.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).get("BUS_VOLTAGE")       # V
        325
        """
        request = self._reads.get((register, raw))
        if request is None:
            request = Request.get_register(
                register,
                profile=self._client.profile,
                raw=raw,
                full_scale_amps=self._full_scale_amps,
            )
            self._reads[register, raw] = request
        return self._exchange(request)

    @both_apis
    def set(self, register: str | int, value: float | str, *, raw: bool = False) -> Exchanges[None]:
        """Writes a register (0x01, 4.4) in its unit, or in digits with ``raw=True``.

        ``CONTROL_MODE`` takes ``TORQUE`` and ``SPEED``. ``DAC_OUT1`` and ``DAC_OUT2`` take names of registers.
        A value between two digits raises ``InvalidValueError``; only currents in A are rounded.

        Raises ``RefusedError`` if the drive does not take the value.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).set("SPEED_KP", 1200)
        """
        return self._exchange(self._set(register, value, raw))

    @both_apis
    def set_verified(
        self, register: str | int, value: float | str, *, raw: bool = False, attempts: int = _core.ST_ATTEMPTS
    ) -> Exchanges[int]:
        """Writes a register and reads it back, at most ``attempts`` times. Returns the number of attempts.

        The checksum of a frame has 8 bits and does not detect all damage. The second exchange detects most of
        the rest.

        Raises ``RefusedError`` without a code if the register has another value after the last attempt,
        ``InvalidValueError`` if the register cannot be read back or if writing it moves the motor. If another
        task writes the register in between, that value is overwritten.
        """
        request = self._set(register, value, raw)
        return one(self._client._set_verified(self._number, request, attempts))

    def _set(self, register: str | int, value: float | str, raw: bool) -> Request:
        return Request.set_register(
            register,
            value,
            profile=self._client.profile,
            raw=raw,
            full_scale_amps=self._full_scale_amps,
        )

    @both_apis
    def status(self) -> Exchanges[Status]:
        """Reads the state of the drive's state machine: ``IDLE``, ``RUN``, ``FAULT_NOW`` (STATUS)."""
        return self._exchange(Request.status())

    @both_apis
    def flags(self) -> Exchanges[Flags]:
        """Reads the faults (FLAGS). The value is false if there are none."""
        return self._exchange(Request.flags())

    @both_apis
    def control_mode(self) -> Exchanges[ControlMode]:
        """Reads the control mode: ``TORQUE`` or ``SPEED`` (CONTROL_MODE)."""
        return self._exchange(Request.control_mode())

    @both_apis
    def execute(self, command: str | int) -> Exchanges[None]:
        """Executes a command of table 4 by its name, such as ``RESET``, or by its number (0x03, 4.6).

        An acknowledge does not mean that the command had an effect: read :meth:`status`.
        """
        return self._exchange(Request.execute_command(command))

    @both_apis
    def start(self) -> Exchanges[None]:
        """Starts the motor (4.6), then reads its state: two exchanges, three with a fault.

        A drive acknowledges a start in any case. Raises ``RefusedError`` without a code if a fault is pending,
        or if the motor is still stopping. The message names the faults.

        The drive acts in its control mode, also after a stop: in ``TORQUE`` mode the motor starts with the
        last current reference, and the load decides the speed. :meth:`set_ramp` returns to speed control.
        With a ``speed_limit_rpm``, call :meth:`set_ramp` first: the drive may keep an older target.
        """
        yield self._exchange(Request.execute_command("START_MOTOR"))
        starting = _core.StStarting(self._number)
        while (register := starting.register()) is not None:
            starting.replied((yield self._read(register)))

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor (4.6)."""
        return self._exchange(Request.execute_command("STOP_MOTOR"))

    @both_apis
    def stop_ramp(self) -> Exchanges[None]:
        """Stops the current ramp (4.6). The motor keeps its speed."""
        return self._exchange(Request.execute_command("STOP_RAMP"))

    @both_apis
    def fault_ack(self) -> Exchanges[None]:
        """Acknowledges faults that are over (4.6)."""
        return self._exchange(Request.execute_command("FAULT_ACK"))

    @both_apis
    def encoder_align(self) -> Exchanges[None]:
        """Aligns the encoder (4.6)."""
        return self._exchange(Request.execute_command("ENCODER_ALIGN"))

    @both_apis
    def start_stop(self) -> Exchanges[None]:
        """Starts the motor if it is stopped, otherwise stops it (4.6)."""
        return self._exchange(Request.execute_command("START_STOP"))

    @both_apis
    def iqdref_clear(self) -> Exchanges[None]:
        """Resets the current references to their values at power-on (4.6)."""
        return self._exchange(Request.execute_command("IQDREF_CLEAR"))

    @both_apis
    def pfc_enable(self) -> Exchanges[None]:
        """Switches the power factor correction on (4.6)."""
        return self._exchange(Request.execute_command("PFC_ENABLE"))

    @both_apis
    def pfc_disable(self) -> Exchanges[None]:
        """Switches the power factor correction off (4.6)."""
        return self._exchange(Request.execute_command("PFC_DISABLE"))

    @both_apis
    def pfc_fault_ack(self) -> Exchanges[None]:
        """Acknowledges faults of the power factor correction (4.6)."""
        return self._exchange(Request.execute_command("PFC_FAULT_ACK"))

    @both_apis
    def set_ramp(self, speed_rpm: float, duration_s: float) -> Exchanges[None]:
        """Ramps the speed to ``speed_rpm`` in ``duration_s`` (0x07, 4.8).

        In RUN the ramp starts at once, otherwise when the motor reaches RUN. Values are rounded to 1 rpm and
        1 ms. ``duration_s`` is 0, a step, to 65.535 s.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).set_ramp(1500, 1.0)      # rpm, s
        """
        return self._exchange(Request.set_ramp(speed_rpm, duration_s))

    @both_apis
    def set_current_reference(self, iq: float, id: float) -> Exchanges[None]:
        """Sets the current references Iq and Id (0x0A, 4.11), in A with ``full_scale_amps``, otherwise in digits.

        A ``speed_limit_rpm`` does not hold then.
        """
        return self._exchange(Request.set_current_reference(iq, id, full_scale_amps=self._full_scale_amps))

    @both_apis
    def set_torque_ramp(self, torque: float, duration_s: float) -> Exchanges[None]:
        """Ramps the torque current Iq to ``torque`` in ``duration_s`` (0x0D of profile ``mcsdk-5.4``).

        ``torque`` is in A with ``full_scale_amps``, otherwise in digits. A ``speed_limit_rpm`` does not hold
        then. Raises ``InvalidValueError`` with another profile, where these bytes are another command.
        """
        self._only("mcsdk-5.4", "torque ramps")
        full_scale_amps = self._full_scale_amps
        return self._exchange(
            Request.set_torque_ramp(torque, duration_s, full_scale_amps=full_scale_amps)
        )

    @both_apis
    def set_position(
        self,
        angle_rad: float,
        duration_s: float,
        *,
        wait: bool = False,
        arrival_tolerance_rad: float | None = None,
        timeout: float | None = None,
    ) -> Exchanges[None]:
        """Turns to ``angle_rad`` in ``duration_s`` (0x12 of profile ``mcsdk-5.4``, with position control).

        Raises ``InvalidValueError`` if there is a ``speed_limit_rpm``: the command has no speed.

        ``wait=True`` returns when the motor has arrived: ``duration_s`` is over, it is at most
        ``arrival_tolerance_rad`` from the target (by default 0.01) and its position does not change for
        0.25 s. Otherwise ``NotArrivedError`` is raised, and the motor still has its command. A motor that is
        not in RUN, nor on its way there, gets no command. ``timeout``, s, is by default ``duration_s`` and
        10 s. Without ``wait=True`` both arguments are refused.
        """
        self._only("mcsdk-5.4", "moves")
        request = Request.set_position(angle_rad, duration_s)
        needs_wait(wait, arrival_tolerance_rad=arrival_tolerance_rad, timeout=timeout)
        move = self._sent(request)
        if wait:
            watch = _core.st_arrival(
                self._number, angle_rad, duration_s, arrival_tolerance_rad, timeout
            )
            move = moved(self._client, watch, self._read, self._client._confirm, move)
        yield from move

    def _sent(self, request: Request) -> Exchanges[None]:
        yield self._exchange(request)

    def _read(self, register: int) -> Any:
        return self._client._exchange_raw(self._number, 0x02, bytes([register]))

    @both_apis
    def revup_data(self, phase: int) -> Exchanges[RevupPhase]:
        """Reads a phase of the rev-up, 0 to 4 (0x08, 4.9)."""
        request = Request.get_revup_data(phase, full_scale_amps=self._full_scale_amps)
        return self._exchange(request)

    @both_apis
    def set_revup_data(
        self, phase: int, speed_rpm: float, torque: float, duration_s: float
    ) -> Exchanges[None]:
        """Sets a phase of the rev-up, 0 to 4 (0x09, 4.10).

        ``speed_rpm`` and ``torque`` are the values at the end of the phase, ``duration_s`` is its length.
        ``torque`` is Iq, in A with ``full_scale_amps``, otherwise in digits.
        """
        full_scale_amps = self._full_scale_amps
        return self._exchange(
            Request.set_revup_data(
                phase, speed_rpm, torque, duration_s, full_scale_amps=full_scale_amps
            )
        )

    @both_apis
    def configure_segment(self, segment: int, registers: Sequence[str | int]) -> Exchanges[None]:
        """Selects the registers of a data segment, 0 to 3 (0x0E, profile ``spec``). At most 32.

        The drive has one set of segments for all its motors and keeps it until power-off.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).configure_segment(0, ["SPEED_MEAS", "BUS_VOLTAGE"])
        ...     client.motor(1).segment(0)
        {'SPEED_MEAS': 0, 'BUS_VOLTAGE': 325}
        """
        self._only("spec", "data segments")
        request = Request.configure_segment(segment, registers)
        self._client._segments.claim(segment)
        yield self._exchange(request)
        self._client._segments.chosen(segment, registers)

    @both_apis
    def segment(
        self, segment: int, registers: Sequence[str | int] | None = None, *, raw: bool = False
    ) -> Exchanges[dict[str, float]]:
        """Reads a data segment (0x0D, profile ``spec``). Returns the values of its registers by name.

        Call :meth:`configure_segment` first, also after the port was opened again. Otherwise
        ``InvalidValueError`` is raised and nothing is sent: shipped firmware reads this request as a torque
        ramp. ``registers`` are those that the segment was configured with, and may be left out.
        """
        self._only("spec", "data segments")
        if registers is None:
            registers = self._client._segments.registers(segment)
        request = Request.get_segment(
            segment, registers, raw=raw, full_scale_amps=self._full_scale_amps
        )
        return self._exchange(request)

    def _only(self, profile: str, what: str) -> None:
        """Raises if the client has another profile."""
        client = self._client
        if client.profile != profile:
            raise InvalidValueError(
                f"{what} need profile {profile}, and {client.port} was opened with profile"
                f" {client.profile}; nothing was sent",
                port=client.port,
                motor=self._number,
            )

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._number} on {self._client.port}>"
