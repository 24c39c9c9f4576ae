"""Buses and motors of ST's serial Motor Control Protocol, for both APIs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, one
from motorlink._bus import AnyBus
from motorlink._core import StRequest as Request
from motorlink._sampling import Samples, array, by_motor, skips
from motorlink._segments import Segments
from motorlink._values import ControlMode, Faults, FirmwareVersion, Info, RevupPhase, State
from motorlink.errors import BadValue

if TYPE_CHECKING:
    from typing_extensions import Self

MotorT = TypeVar("MotorT", bound="StMotor[Any]")
PortT = TypeVar("PortT")
BusT = TypeVar("BusT", bound="StBus[Any, Any]")


class StBus(AnyBus, Generic[MotorT, PortT]):
    """The buses of both APIs."""

    _ENDS: ClassVar[dict[str, dict[str, bool]]] = {"stop": {"stop": True}, "nothing": {"stop": False}}
    _Motor: type[MotorT]
    # Each API's exchanges, with the arguments of ``StClient``'s methods.
    _exchange: Any
    _exchange_raw: Any
    _write_verified: Any
    _sample: Any

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
        timeout: float = 1.0,
        speed_limit: float | None = None,
        current_limit: float | None = None,
        full_scale_amps: float | None = None,
        recovery: str = "drain",
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ) -> Callable[[], Exchanges[Self]]:
        """Opens a serial line with a drive. Nothing is sent.

        For asyncio: ``async with open(...) as bus``, or ``await open(...)``.

        ``port``
            ``/dev/ttyACM0``, ``serial:/dev/ttyUSB0?baud=115200``, ``tcp:HOST:PORT``, ``unix:PATH``,
            the path of a pty, ``sim:`` for a simulated drive inside the process, or, not for asyncio, a
            bench of ``motorlink.sim``.
        ``profile``
            ``spec``: the document; ``mcsdk-5.4``: what shipped firmware really does.
        ``timeout``
            How long to wait for a reply, s (4.1 says 1 s).
        ``speed_limit``, ``current_limit``
            What no request may exceed in either direction, rpm, and A with ``full_scale_amps``, digits
            without; also not by writing registers or raw frames. Rounded towards 0 to what a frame can
            say. With a speed limit a motor is started only after a ``ramp`` within it, and ``move_to`` is
            refused. The ramp no longer counts after a torque command, a write of CONTROL_MODE, a reset
            of the drive, or a lost line or port. A speed limit does not bound the speed under a torque
            command (``current``, ``torque_ramp``), which is as fast as the load allows, nor the
            drive's own rev-up, alignment and motor profiler.
        ``full_scale_amps``
            The current of digit 32767, A, for every motor that is not given its own.
        ``recovery``
            How a lost line comes back before the next exchange: ``drain``; ``pad``, for 5.x drives that
            wait for the rest of a cut-off frame; ``none``.
        ``on_close``
            ``stop``: the end of ``with``, and ``close()``, stop the motors that this bus started;
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
            speed_limit=speed_limit,
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
    def started(self) -> list[int]:
        """Numbers of the motors that this bus started and did not stop."""
        started: list[int] = self._core.started
        return started

    def motor(self, number: int = 1, *, full_scale_amps: float | None = None) -> MotorT:
        """A motor of the drive, 1 to 7; 0 is whichever the drive has selected (TARGET_MOTOR)."""
        if full_scale_amps is None:
            full_scale_amps = self._full_scale_amps
        return self._Motor(self, number, full_scale_amps)

    @both_apis
    def info(self) -> Exchanges[Info]:
        """Version and name of the SDK (4.7)."""
        return one(self._exchange(0, Request.info()))

    @both_apis
    def firmware_version(self) -> Exchanges[FirmwareVersion]:
        """Name and version of the firmware (4.12)."""
        return one(self._exchange(0, Request.firmware_version()))

    @both_apis
    def perform(self, motor: int, request: Request) -> Exchanges[Any]:
        """One exchange with a motor; gives what the request makes of the reply."""
        return one(self._exchange(motor, request))

    @both_apis
    def exchange_raw(self, code: int, payload: bytes = b"", *, motor: int = 0) -> Exchanges[bytes]:
        """One exchange with any frame code, 0 to 0x1f, and payload; gives the payload of the answer.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as bus:
        ...     bus.exchange_raw(0x02, b"\\x1e", motor=1)       # GET_REG, SPEED_MEAS
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
        >>> with motorlink.st.open("sim:") as bus:
        ...     data = bus.sample(["SPEED_MEAS", "BUS_VOLTAGE"], rate=100, seconds=0.1)
        >>> data.dtype.names
        ('t', 'SPEED_MEAS', 'BUS_VOLTAGE')

        ``t`` is the moment, s since the first instant, at which the row's first request left; the
        other fields are in their units, or digits with ``raw=True``. Instants do not drift. One that
        the line was too slow for is missing, and no row is ever made up: look at ``t``.

        The registers of a row come in one exchange, of the same moment, where the drive has data
        segments (profile ``spec``); one a motor is used, from segment 3 down, of those that neither
        ``configure_segment`` nor another ``sample`` of this bus has. Otherwise they are read one by
        one. ``{1: ["SPEED_MEAS"], 2: ["SPEED_MEAS"]}`` samples several motors; their
        fields are ``SPEED_MEAS_1`` and ``SPEED_MEAS_2``.

        A row that fails raises, with what was sampled before in the exception's ``samples``; with
        ``on_error="skip"`` a line that fails costs the row only. Ctrl-C ends it, with ``samples`` too; so
        does the cancellation of a task. Exchanges of other tasks have their turns in between.
        """
        skip = skips(on_error)
        wanted, names = by_motor(registers, motor, _core.st_register_name)
        motors = [(number, some, self._full_scale_amps) for number, some in wanted]
        with self._segments.for_sampling(len(motors)) as segments:
            outcome = yield self._sample(motors, segments, rate, seconds, raw, skip)
        return array(outcome, names, raw=raw)

    def __repr__(self) -> str:
        return self._text(f", profile {self._profile}")


class StMotor(Generic[BusT]):
    """The motors of both APIs."""

    __slots__ = ("__weakref__", "_bus", "_full_scale_amps", "_number", "_reads")

    def __init__(self, bus: BusT, number: int, full_scale_amps: float | None):
        self._bus = bus
        self._number = _core.st_motor(number)
        self._full_scale_amps = full_scale_amps
        self._reads: dict[tuple[str | int, bool], Request] = {}

    @property
    def bus(self) -> BusT:
        """The line."""
        return self._bus

    @property
    def number(self) -> int:
        """The motor's number."""
        return self._number

    @property
    def full_scale_amps(self) -> float | None:
        """The current of digit 32767, A; ``None`` while currents are digits."""
        return self._full_scale_amps

    def _perform(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._bus._exchange(self._number, request)
        return given

    @both_apis
    def read(self, register: str | int, *, raw: bool = False) -> Exchanges[float]:
        """Reads a register (4.5), in its unit, or in digits with ``raw=True``.

        An integer where a digit is one unit, else a float. States and flags are their numbers here;
        :meth:`status` and :meth:`faults` have them in words.
        """
        request = self._reads.get((register, raw))
        if request is None:
            request = Request.read(
                register,
                profile=self._bus.profile,
                raw=raw,
                full_scale_amps=self._full_scale_amps,
            )
            self._reads[register, raw] = request
        return self._perform(request)

    @both_apis
    def write(self, register: str | int, value: float | str, *, raw: bool = False) -> Exchanges[None]:
        """Writes a register (4.4), in its unit, or in digits with ``raw=True``.

        ``CONTROL_MODE`` takes ``TORQUE`` and ``SPEED``, ``DAC_OUT1`` and ``DAC_OUT2`` names of
        registers. A value between two digits is a ``BadValue``; only currents in A are rounded.
        """
        return self._perform(self._write(register, value, raw))

    @both_apis
    def write_verified(
        self, register: str | int, value: float | str, *, raw: bool = False, attempts: int = 3
    ) -> Exchanges[int]:
        """Writes a register, reads it back, and repeats both until it has the value.

        Gives the number of the attempt that did it. A checksum of 8 bits lets some damage
        through, which two exchanges seldom do.

        Raises ``Refused`` (without a code) where the register has another value after the last
        attempt, ``BadValue`` where it cannot be read back or where writing it moves the motor. What
        another task writes to the register in between is found, and written over.
        """
        request = self._write(register, value, raw)
        return one(self._bus._write_verified(self._number, request, attempts))

    def _write(self, register: str | int, value: float | str, raw: bool) -> Request:
        return Request.write(
            register,
            value,
            profile=self._bus.profile,
            raw=raw,
            full_scale_amps=self._full_scale_amps,
        )

    @both_apis
    def status(self) -> Exchanges[State]:
        """The state of its state machine, in words: ``IDLE``, ``RUN``, ``FAULT_NOW`` (STATUS)."""
        return self._perform(Request.state())

    @both_apis
    def faults(self) -> Exchanges[Faults]:
        """Its faults (FLAGS); false when there are none."""
        return self._perform(Request.faults())

    @both_apis
    def control_mode(self) -> Exchanges[ControlMode]:
        """``TORQUE`` or ``SPEED`` (CONTROL_MODE)."""
        return self._perform(Request.control_mode())

    @both_apis
    def execute(self, command: str | int) -> Exchanges[None]:
        """Executes a command by its name in table 4, such as ``PFC_ENABLE``, or its number (4.6).

        An acknowledge does not say that it had an effect: look at :meth:`status`.
        """
        return self._perform(Request.execute(command))

    @both_apis
    def start(self) -> Exchanges[None]:
        """Starts the motor (4.6). With a fault pending the drive acknowledges and does nothing.

        With a ``speed_limit``, call :meth:`ramp` before: the drive may have a target of its own.
        """
        return self._perform(Request.execute("START_MOTOR"))

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor (4.6)."""
        return self._perform(Request.execute("STOP_MOTOR"))

    @both_apis
    def stop_ramp(self) -> Exchanges[None]:
        """Stops the ramp that is executing; the speed stays (4.6)."""
        return self._perform(Request.execute("STOP_RAMP"))

    @both_apis
    def acknowledge_faults(self) -> Exchanges[None]:
        """Acknowledges faults whose cause is gone (4.6)."""
        return self._perform(Request.execute("FAULT_ACK"))

    @both_apis
    def align_encoder(self) -> Exchanges[None]:
        """Aligns the encoder (4.6)."""
        return self._perform(Request.execute("ENCODER_ALIGN"))

    @both_apis
    def ramp(self, speed: float, seconds: float) -> Exchanges[None]:
        """Goes to ``speed``, rpm, within ``seconds``: at once in RUN, else when RUN is reached (4.8).

        Rounded to 1 rpm and 1 ms; a time is 0, a step, to 65.535 s.
        """
        return self._perform(Request.ramp(speed, seconds))

    @both_apis
    def current(self, iq: float, id: float = 0.0) -> Exchanges[None]:
        """Sets the current references (4.11); A with ``full_scale_amps``, else digits.

        No ``speed_limit`` bounds the motor then.
        """
        return self._perform(Request.current(iq, id, full_scale_amps=self._full_scale_amps))

    @both_apis
    def torque_ramp(self, iq: float, seconds: float) -> Exchanges[None]:
        """Goes to ``iq`` within ``seconds``; A with ``full_scale_amps``, else digits.

        Of profile ``mcsdk-5.4``; for others the same bytes ask for something else. No
        ``speed_limit`` bounds the motor then.
        """
        self._only("mcsdk-5.4", "torque ramps")
        return self._perform(Request.torque_ramp(iq, seconds, full_scale_amps=self._full_scale_amps))

    @both_apis
    def move_to(self, angle_rad: float, seconds: float) -> Exchanges[None]:
        """Turns to ``angle_rad``, rad, within ``seconds``; profile ``mcsdk-5.4`` with position control.

        Refused while there is a ``speed_limit``: the command carries no speed.
        """
        self._only("mcsdk-5.4", "moves")
        return self._perform(Request.move_to(angle_rad, seconds))

    @both_apis
    def revup(self, phase: int) -> Exchanges[RevupPhase]:
        """A phase of the rev-up, 0 to 4 (4.9)."""
        request = Request.revup(phase, full_scale_amps=self._full_scale_amps)
        return self._perform(request)

    @both_apis
    def set_revup(self, phase: int, speed: float, current: float, seconds: float) -> Exchanges[None]:
        """Sets a phase of the rev-up, 0 to 4 (4.10).

        Speed, rpm, and Iq, A with ``full_scale_amps``, else digits, at the end of the phase; and how
        long it is, s.
        """
        full_scale_amps = self._full_scale_amps
        return self._perform(
            Request.set_revup(phase, speed, current, seconds, full_scale_amps=full_scale_amps)
        )

    @both_apis
    def configure_segment(self, segment: int, registers: Sequence[str | int]) -> Exchanges[None]:
        """Chooses the registers, at most 32, of a data segment, 0 to 3 (profile ``spec``).

        The drive keeps one set of segments for all of its motors, until it is powered off.
        """
        self._only("spec", "data segments")
        request = Request.configure_segment(segment, registers)
        self._bus._segments.claim(segment)
        yield self._perform(request)
        self._bus._segments.chosen(segment, registers)

    @both_apis
    def read_segment(
        self, segment: int, registers: Sequence[str | int] | None = None, *, raw: bool = False
    ) -> Exchanges[dict[str, float]]:
        """Reads a data segment in one exchange: the registers' values by name (profile ``spec``).

        ``registers``: what it was configured with, unless it was by this bus.
        """
        self._only("spec", "data segments")
        if registers is None:
            registers = self._bus._segments.registers(segment)
        request = Request.read_segment(
            segment, registers, raw=raw, full_scale_amps=self._full_scale_amps
        )
        return self._perform(request)

    def _only(self, profile: str, what: str) -> None:
        """Refuses what another profile than that of the bus has."""
        bus = self._bus
        if bus.profile != profile:
            raise BadValue(
                f"{what} are of profile {profile}, and {bus.port} was opened with profile {bus.profile};"
                " nothing was sent",
                port=bus.port,
                motor=self._number,
            )

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._number} on {self._bus.port}>"
