"""Clients and motors of ST's serial Motor Control Protocol, for both APIs."""

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
from motorlink._values import BoardInfo, ControlMode, FirmwareVersion, Flags, RevupPhase, Status
from motorlink.errors import InvalidValueError

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound="StMotor[Any]")
PortT = TypeVar("PortT")
SamplingT = TypeVar("SamplingT", bound=AnySampling)
ClientT = TypeVar("ClientT", bound="StClient[Any, Any, Any]")


class StClient(AnyClient, Generic[MotorT, PortT, SamplingT]):
    """The clients of both APIs."""

    _ENDS: ClassVar[dict[str, dict[str, bool]]] = {"stop": {"stop": True}, "nothing": {"stop": False}}
    _Motor: type[MotorT]
    _Sampling: type[SamplingT]
    # Each API's exchanges, with the arguments of ``StClient``'s methods.
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
        """Opens a serial line with a drive. Nothing is sent.

        For asyncio: ``async with open(...) as client``, or ``await open(...)``.

        ``port``
            ``/dev/ttyACM0``, ``serial:/dev/ttyUSB0?baud=115200``, ``tcp:HOST:PORT``, ``unix:PATH``,
            the path of a pty, ``sim:`` for a simulated drive inside the process, or, not for asyncio, a
            bench of ``motorlink.sim``.
        ``profile``
            ``spec``: the document; ``mcsdk-5.4``: what shipped firmware really does.
        ``timeout``
            How long to wait for a reply, s (4.1 says 1 s).
        ``speed_limit_rpm``, ``current_limit``
            What no request may exceed in either direction; the current is A with ``full_scale_amps``,
            digits without; also not by writing registers or raw frames. Rounded towards 0 to what a frame
            can say. With a speed limit a motor is started only after a ``set_ramp`` within it, and
            ``set_position`` is refused. The ramp no longer counts after a torque command, a write of
            CONTROL_MODE, a reset of the drive, or a lost line or port. A speed limit does not bound the
            speed under a torque command (``set_current_reference``, ``set_torque_ramp``), which is as fast
            as the load allows, nor the drive's own rev-up, alignment and motor profiler.
        ``full_scale_amps``
            The current of digit 32767, A, for every motor that is not given its own.
        ``recovery``
            How a lost line comes back before the next exchange: ``drain``; ``pad``, for 5.x drives that
            wait for the rest of a cut-off frame; ``none``.
        ``on_close``
            ``stop``: the end of ``with``, and ``close()``, stop the motors that this client started;
            ``nothing``: they run on.
        ``stop_on_signals``
            SIGTERM and SIGHUP do what ``close()`` does, and then end the program as they would have
            without. Handlers are installed if this is called in the main thread, in place of the default
            action only. The last ``close()`` restores it. ``False``: nothing is installed. For asyncio
            the motors are stopped with the event loop at rest.

        Raises ``PortError`` where the port cannot be opened.
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
        """``spec`` or ``mcsdk-5.4``."""
        return self._profile

    @property
    def moving(self) -> list[int]:
        """Numbers of the motors that this client started and did not stop."""
        moving: list[int] = self._core.moving
        return moving

    def motor(self, number: int = 1, *, full_scale_amps: float | None = None) -> MotorT:
        """A motor of the drive, 1 to 7; 0 is whichever the drive has selected (TARGET_MOTOR)."""
        if full_scale_amps is None:
            full_scale_amps = self._full_scale_amps
        return self._Motor(self, number, full_scale_amps)

    @both_apis
    def board_info(self) -> Exchanges[BoardInfo]:
        """Version and name of the SDK (4.7)."""
        return one(self._exchange(0, Request.get_board_info()))

    @both_apis
    def firmware_version(self) -> Exchanges[FirmwareVersion]:
        """Name and version of the firmware (4.12)."""
        return one(self._exchange(0, Request.get_firmware_version()))

    @both_apis
    def exchange(self, motor: int, request: Request) -> Exchanges[Any]:
        """One exchange with a motor; gives what the reply says."""
        check_request(request, Request, "Request.status()")
        return one(self._exchange(motor, request))

    @both_apis
    def confirm(self) -> Exchanges[None]:
        """Makes sure that the replies so far went to their own requests, before you rely on what you read: one
        exchange more. A reply that came twice or late is ``LinkError``: read again.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     volts = client.motor(1).get("BUS_VOLTAGE")
        ...     client.confirm()
        """
        return one(self._confirm())

    @both_apis
    def raw(self, code: int, payload: bytes = b"", *, motor: int = 0) -> Exchanges[bytes]:
        """One exchange with any frame code, 0 to 0x1f, and payload; gives the payload of the answer.

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
        """Reads registers ``rate`` times a second for ``seconds``; gives a structured array.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     data = client.sample(["SPEED_MEAS", "BUS_VOLTAGE"], rate=100, seconds=0.1)
        >>> data.dtype.names
        ('t', 'SPEED_MEAS', 'BUS_VOLTAGE')

        ``t`` is the moment, s since the first instant, at which the row's first request left; the
        other fields are in their units, or digits with ``raw=True``. Instants do not drift. One that
        the line was too slow for is missing, and no row is ever made up: look at ``t``.

        The registers of a row come in one exchange, of the same moment, where the drive has data
        segments (profile ``spec``); one a motor is used, from segment 3 down, of those that neither
        ``configure_segment`` nor another ``sample`` of this client has. Otherwise they are read one by
        one. ``{1: ["SPEED_MEAS"], 2: ["SPEED_MEAS"]}`` samples several motors; their
        fields are ``SPEED_MEAS_1`` and ``SPEED_MEAS_2``.

        A row that fails raises, with what was sampled before in the exception's ``samples``; with
        ``on_error="skip"`` a line that fails costs the row only. Ctrl-C ends it, with ``samples`` too; so
        does the cancellation of a task. Exchanges of other tasks have their turns in between.
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
        """Reads registers ``rate`` times a second, a row each time that the loop asks for one.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     for row in client.samples(["SPEED_MEAS", "BUS_VOLTAGE"], rate=100):
        ...         print(row.t, row["SPEED_MEAS"], row["BUS_VOLTAGE"])
        ...         break
        0.0 0.0 325.0

        For asyncio: ``async for row in client.samples(...)``. Arguments, names, units and instants are those
        of :meth:`sample`; without ``seconds`` there is no end. A row is a ``dict``, a
        :class:`motorlink.Sample`. No thread reads ahead: a row is read when the loop asks for it, so that
        its values are new. A loop that is slower than ``rate`` gets fewer rows; ``row.skipped`` is the number
        of instants before the row that have none.

        ``break`` leaves motors as they are; the end of ``with`` stops those that this client started. So
        does Ctrl-C, and an error, which is raised after the rows that were read before. After an error
        there are no more rows: call ``samples`` again.
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
    """The motors of both APIs."""

    __slots__ = ("__weakref__", "_client", "_full_scale_amps", "_number", "_reads")

    def __init__(self, client: ClientT, number: int, full_scale_amps: float | None):
        self._client = client
        self._number = _core.st_motor(number)
        self._full_scale_amps = full_scale_amps
        self._reads: dict[tuple[str | int, bool], Request] = {}

    @property
    def client(self) -> ClientT:
        """The client that it is of."""
        return self._client

    @property
    def number(self) -> int:
        """The motor's number."""
        return self._number

    @property
    def full_scale_amps(self) -> float | None:
        """The current of digit 32767, A; ``None`` while currents are digits."""
        return self._full_scale_amps

    def _exchange(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._client._exchange(self._number, request)
        return given

    @both_apis
    def get(self, register: str | int, *, raw: bool = False) -> Exchanges[float]:
        """Reads a register (4.5), in its unit, or in digits with ``raw=True``.

        An integer where a digit is one unit, else a float. States and flags are their numbers here;
        :meth:`status` and :meth:`flags` have them in words.
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
        """Writes a register (4.4), in its unit, or in digits with ``raw=True``.

        ``CONTROL_MODE`` takes ``TORQUE`` and ``SPEED``, ``DAC_OUT1`` and ``DAC_OUT2`` names of
        registers. A value between two digits is a ``InvalidValueError``; only currents in A are rounded.
        """
        return self._exchange(self._set(register, value, raw))

    @both_apis
    def set_verified(
        self, register: str | int, value: float | str, *, raw: bool = False, attempts: int = _core.ST_ATTEMPTS
    ) -> Exchanges[int]:
        """Writes a register, reads it back, and repeats both until it has the value.

        Gives the number of the attempt that did it. A checksum of 8 bits lets some damage
        through, which two exchanges seldom do.

        Raises ``RefusedError`` (without a code) where the register has another value after the last
        attempt, ``InvalidValueError`` where it cannot be read back or where writing it moves the motor. What
        another task writes to the register in between is found, and written over.
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
        """The state of its state machine, in words: ``IDLE``, ``RUN``, ``FAULT_NOW`` (STATUS)."""
        return self._exchange(Request.status())

    @both_apis
    def flags(self) -> Exchanges[Flags]:
        """Its faults (FLAGS); false when there are none."""
        return self._exchange(Request.flags())

    @both_apis
    def control_mode(self) -> Exchanges[ControlMode]:
        """``TORQUE`` or ``SPEED`` (CONTROL_MODE)."""
        return self._exchange(Request.control_mode())

    @both_apis
    def execute(self, command: str | int) -> Exchanges[None]:
        """Executes a command by its name in table 4, such as ``RESET``, or its number (4.6).

        An acknowledge does not say that it had an effect: look at :meth:`status`.
        """
        return self._exchange(Request.execute_command(command))

    @both_apis
    def start(self) -> Exchanges[None]:
        """Starts the motor (4.6). With a fault pending the drive acknowledges and does nothing.

        With a ``speed_limit_rpm``, call :meth:`set_ramp` before: the drive may have a target of its own.
        """
        return self._exchange(Request.execute_command("START_MOTOR"))

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor (4.6)."""
        return self._exchange(Request.execute_command("STOP_MOTOR"))

    @both_apis
    def stop_ramp(self) -> Exchanges[None]:
        """Stops the ramp that is executing; the speed stays (4.6)."""
        return self._exchange(Request.execute_command("STOP_RAMP"))

    @both_apis
    def fault_ack(self) -> Exchanges[None]:
        """Acknowledges faults whose cause is gone (4.6)."""
        return self._exchange(Request.execute_command("FAULT_ACK"))

    @both_apis
    def encoder_align(self) -> Exchanges[None]:
        """Aligns the encoder (4.6)."""
        return self._exchange(Request.execute_command("ENCODER_ALIGN"))

    @both_apis
    def start_stop(self) -> Exchanges[None]:
        """Starts the motor if it stands, else stops it (4.6)."""
        return self._exchange(Request.execute_command("START_STOP"))

    @both_apis
    def iqdref_clear(self) -> Exchanges[None]:
        """Sets the current references back to what they were at power-on (4.6)."""
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
        """Goes to ``speed_rpm`` within ``duration_s``: at once in RUN, else when RUN is reached (4.8).

        Rounded to 1 rpm and 1 ms; a time is 0, a step, to 65.535 s.
        """
        return self._exchange(Request.set_ramp(speed_rpm, duration_s))

    @both_apis
    def set_current_reference(self, iq: float, id: float) -> Exchanges[None]:
        """Sets the current references (4.11); A with ``full_scale_amps``, else digits.

        No ``speed_limit_rpm`` bounds the motor then.
        """
        return self._exchange(Request.set_current_reference(iq, id, full_scale_amps=self._full_scale_amps))

    @both_apis
    def set_torque_ramp(self, torque: float, duration_s: float) -> Exchanges[None]:
        """Goes to ``torque``, an Iq, within ``duration_s``; A with ``full_scale_amps``, else digits.

        Of profile ``mcsdk-5.4``; for others the same bytes ask for something else. No
        ``speed_limit_rpm`` bounds the motor then.
        """
        self._only("mcsdk-5.4", "torque ramps")
        full_scale_amps = self._full_scale_amps
        return self._exchange(
            Request.set_torque_ramp(torque, duration_s, full_scale_amps=full_scale_amps)
        )

    @both_apis
    def set_position(self, angle_rad: float, duration_s: float) -> Exchanges[None]:
        """Turns to ``angle_rad`` within ``duration_s``; profile ``mcsdk-5.4`` with position control.

        Refused while there is a ``speed_limit_rpm``: the command carries no speed.
        """
        self._only("mcsdk-5.4", "moves")
        return self._exchange(Request.set_position(angle_rad, duration_s))

    @both_apis
    def revup_data(self, phase: int) -> Exchanges[RevupPhase]:
        """A phase of the rev-up, 0 to 4 (4.9)."""
        request = Request.get_revup_data(phase, full_scale_amps=self._full_scale_amps)
        return self._exchange(request)

    @both_apis
    def set_revup_data(
        self, phase: int, speed_rpm: float, torque: float, duration_s: float
    ) -> Exchanges[None]:
        """Sets a phase of the rev-up, 0 to 4 (4.10).

        Speed and torque, an Iq, A with ``full_scale_amps``, else digits, at the end of the phase; and
        how long it is.
        """
        full_scale_amps = self._full_scale_amps
        return self._exchange(
            Request.set_revup_data(
                phase, speed_rpm, torque, duration_s, full_scale_amps=full_scale_amps
            )
        )

    @both_apis
    def configure_segment(self, segment: int, registers: Sequence[str | int]) -> Exchanges[None]:
        """Chooses the registers, at most 32, of a data segment, 0 to 3 (profile ``spec``).

        The drive keeps one set of segments for all of its motors, until it is powered off.
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
        """Reads a data segment in one exchange: the registers' values by name (profile ``spec``).

        ``registers``: what it was configured with, unless it was by this client.
        """
        self._only("spec", "data segments")
        if registers is None:
            registers = self._client._segments.registers(segment)
        request = Request.get_segment(
            segment, registers, raw=raw, full_scale_amps=self._full_scale_amps
        )
        return self._exchange(request)

    def _only(self, profile: str, what: str) -> None:
        """Refuses what another profile than that of the client has."""
        client = self._client
        if client.profile != profile:
            raise InvalidValueError(
                f"{what} are of profile {profile}, and {client.port} was opened with profile {client.profile};"
                " nothing was sent",
                port=client.port,
                motor=self._number,
            )

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._number} on {self._client.port}>"
