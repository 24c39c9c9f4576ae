"""Drives that speak ST's serial Motor Control Protocol.

>>> import motorlink
>>> with motorlink.st.open("sim:") as bus:       # or "/dev/ttyACM0"
...     motor = bus.motor(1)
...     motor.write("SPEED_KP", 1200)
...     motor.registers.SPEED_KP
1200

Speeds are rpm, times s. Currents are digits of the drive (s16A, of which 32767 is its full scale)
until it is told what full scale is: ``full_scale_amps=17.5`` makes A of them.

Every method of a motor is one exchange unless it says otherwise, and raises

* ``Refused`` where the drive says no (table 2 of the document),
* ``Timeout`` and ``LineLost`` where there is no answer to trust: nobody knows what the drive did,
* ``BadValue`` where nothing was sent: no such motor, out of range, over a limit; of a register that
  nobody knows, its subclass ``errors.NoSuchRegister``, which is a ``KeyError``, too,
* ``Closed`` after ``bus.close()``.

Paragraphs in brackets are those of the document "Motor Control Protocol". Ctrl-C ends a wait for a
silent drive at once; nobody knows then what the drive did, and the next exchange recovers the line
first. ``stop()`` does not wait for that: it is sent at once, and again on the recovered line. While
motors are being stopped at the end Ctrl-C has to wait.

A signal handler may use the bus that the main thread waits for, such as ``motor.stop()`` or
``bus.close()``. The exchange that it interrupted is given up then and raises ``PortError``. A handler
that does not use the bus does not disturb the exchange. If another thread has an exchange under way,
the handler waits until that is over.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

from motorlink import _core
from motorlink._bus import Ending, Port, on_close_checked, only, opened
from motorlink._core import StRequest as Request
from motorlink._registers import Registers
from motorlink._sampling import Samples, array, by_motor, skips
from motorlink._segments import Segments
from motorlink._values import (
    ControlMode,
    Faults,
    FirmwareVersion,
    Info,
    RegisterInfo,
    RevupPhase,
    State,
)

__all__ = [
    "Bus",
    "ControlMode",
    "Faults",
    "FirmwareVersion",
    "Info",
    "Motor",
    "RegisterInfo",
    "Registers",
    "Request",
    "RevupPhase",
    "State",
    "open",
]

_ON_CLOSE = ("stop", "nothing")


def open(
    port: Port,
    *,
    profile: str = "spec",
    timeout: float = 1.0,
    speed_limit: float | None = None,
    current_limit: float | None = None,
    full_scale_amps: float | None = None,
    recovery: str = "drain",
    on_close: str = "stop",
    stop_on_signals: bool = True,
) -> Bus:
    """Opens a serial line with a drive. Nothing is sent.

    ``port``
        ``/dev/ttyACM0``, ``serial:/dev/ttyUSB0?baud=115200``, ``tcp:HOST:PORT``, ``unix:PATH``,
        the path of a pty,
        or ``sim:`` for a simulated drive inside the process.
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
        action only. The last ``close()`` restores it. ``False``: nothing is installed.

    Raises ``PortError`` where the port cannot be opened.
    """
    on_close_checked(on_close, _ON_CLOSE)
    client = _core.StClient.open(
        opened(port),
        profile=profile,
        timeout=timeout,
        recovery=recovery,
        speed_limit=speed_limit,
        current_limit=current_limit,
        full_scale_amps=full_scale_amps,
    )
    return Bus(
        client,
        profile=profile,
        full_scale_amps=full_scale_amps,
        on_close=on_close,
        stop_on_signals=stop_on_signals,
    )


class Bus(Ending):
    """A serial line with a drive of up to seven motors; from :func:`open`.

    Threads may share it: one exchange at a time is on the line, and each caller gets its own answer.
    """

    def __init__(
        self,
        client: _core.StClient,
        *,
        profile: str = "spec",
        full_scale_amps: float | None = None,
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ):
        self._client = client
        self._profile = profile
        self._full_scale_amps = full_scale_amps
        stop = on_close_checked(on_close, _ON_CLOSE) == "stop"
        close = functools.partial(client.close, stop=stop)
        super().__init__(close, client.port, stop_on_signals=stop_on_signals and stop)
        self._segments = Segments()

    @property
    def profile(self) -> str:
        """``spec`` or ``mcsdk-5.4``."""
        return self._profile

    @property
    def started(self) -> list[int]:
        """Numbers of the motors that this bus started and did not stop."""
        return self._client.started

    def motor(self, number: int = 1, *, full_scale_amps: float | None = None) -> Motor:
        """A motor of the drive, 1 to 7; 0 is whichever the drive has selected (TARGET_MOTOR)."""
        if full_scale_amps is None:
            full_scale_amps = self._full_scale_amps
        return Motor(self, number, full_scale_amps)

    def info(self) -> Info:
        """Version and name of the SDK (4.7)."""
        info: Info = self.perform(0, Request.info())
        return info

    def firmware_version(self) -> FirmwareVersion:
        """Name and version of the firmware (4.12)."""
        version: FirmwareVersion = self.perform(0, Request.firmware_version())
        return version

    def perform(self, motor: int, request: Request) -> Any:
        """One exchange with a motor; gives what the request makes of the reply."""
        return self._client.perform(motor, request)

    def confirm(self) -> None:
        """Makes sure that the replies so far went to their own requests, before you rely on what you read: one
        exchange more. A reply that came twice or late is ``LineLost``: read again.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as bus:
        ...     volts = bus.motor(1).read("BUS_VOLTAGE")
        ...     bus.confirm()
        """
        self._client.confirm()

    def exchange_raw(self, code: int, payload: bytes = b"", *, motor: int = 0) -> bytes:
        """One exchange with any frame code, 0 to 0x1f, and payload; gives the payload of the answer.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as bus:
        ...     bus.exchange_raw(0x02, b"\\x1e", motor=1)       # GET_REG, SPEED_MEAS
        b'\\x00\\x00\\x00\\x00'
        """
        return self._client.exchange_raw(motor, code, payload)

    def sample(
        self,
        registers: Sequence[str | int] | Mapping[int, Sequence[str | int]],
        *,
        rate: float,
        seconds: float,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> Samples:
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
        ``on_error="skip"`` a line that fails costs the row only. Ctrl-C ends it, with ``samples`` too.
        """
        skip = skips(on_error)
        wanted, names = by_motor(registers, motor, _core.st_register_name)
        motors = [(number, some, self._full_scale_amps) for number, some in wanted]
        with self._segments.for_sampling(len(motors)) as segments:
            outcome = self._client.sample(motors, segments, rate, seconds, raw, skip)
        return array(outcome, names, raw=raw)

    def __repr__(self) -> str:
        closed = ", closed" if self._client.is_closed else ""
        return f"<motorlink.st.Bus {self.port}, profile {self._profile}{closed}>"


class Motor:
    """One motor of a drive; from :meth:`Bus.motor`."""

    def __init__(self, bus: Bus, number: int, full_scale_amps: float | None):
        self._bus = bus
        self._number = _core.st_motor(number)
        self._full_scale_amps = full_scale_amps
        self._reads: dict[tuple[str | int, bool], Request] = {}

    @property
    def bus(self) -> Bus:
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

    @property
    def registers(self) -> Registers:
        """The registers as a mapping: ``motor.registers["SPEED_KP"]``, ``motor.registers.SPEED_KP``."""
        return Registers(self)

    def _perform(self, request: Request) -> Any:
        return self._bus.perform(self._number, request)

    def read(self, register: str | int, *, raw: bool = False) -> float:
        """Reads a register (4.5), in its unit, or in digits with ``raw=True``.

        An integer where a digit is one unit, else a float. States and flags are their numbers here;
        :attr:`state` and :attr:`faults` have them in words.
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
        value: float = self._perform(request)
        return value

    def write(self, register: str | int, value: float | str, *, raw: bool = False) -> None:
        """Writes a register (4.4), in its unit, or in digits with ``raw=True``.

        ``CONTROL_MODE`` takes ``TORQUE`` and ``SPEED``, ``DAC_OUT1`` and ``DAC_OUT2`` names of
        registers. A value between two digits is a ``BadValue``; only currents in A are rounded.
        """
        self._perform(self._write(register, value, raw))

    def write_verified(
        self, register: str | int, value: float | str, *, raw: bool = False, attempts: int = 3
    ) -> int:
        """Writes a register, reads it back, and repeats both until it has the value.

        Gives the number of the attempt that did it. A checksum of 8 bits lets some damage
        through, which two exchanges seldom do.

        Raises ``Refused`` (without a code) where the register has another value after the last
        attempt, ``BadValue`` where it cannot be read back or where writing it moves the motor.
        """
        request = self._write(register, value, raw)
        return self._bus._client.write_verified(self._number, request, attempts)

    def _write(self, register: str | int, value: float | str, raw: bool) -> Request:
        return Request.write(
            register,
            value,
            profile=self._bus.profile,
            raw=raw,
            full_scale_amps=self._full_scale_amps,
        )

    @property
    def status(self) -> State:
        """The state of its state machine, in words: ``IDLE``, ``RUN``, ``FAULT_NOW`` (STATUS)."""
        state: State = self._perform(Request.state())
        return state

    @property
    def faults(self) -> Faults:
        """Its faults (FLAGS); false when there are none."""
        faults: Faults = self._perform(Request.faults())
        return faults

    @property
    def control_mode(self) -> ControlMode:
        """``TORQUE`` or ``SPEED`` (CONTROL_MODE)."""
        mode: ControlMode = self._perform(Request.control_mode())
        return mode

    def execute(self, command: str | int) -> None:
        """Executes a command by its name in table 4, such as ``PFC_ENABLE``, or its number (4.6).

        An acknowledge does not say that it had an effect: look at :attr:`status`.
        """
        self._perform(Request.execute(command))

    def start(self) -> None:
        """Starts the motor (4.6). With a fault pending the drive acknowledges and does nothing.

        With a ``speed_limit``, call :meth:`ramp` before: the drive may have a target of its own.
        """
        self.execute("START_MOTOR")

    def stop(self) -> None:
        """Stops the motor (4.6)."""
        self.execute("STOP_MOTOR")

    def stop_ramp(self) -> None:
        """Stops the ramp that is executing; the speed stays (4.6)."""
        self.execute("STOP_RAMP")

    def acknowledge_faults(self) -> None:
        """Acknowledges faults whose cause is gone (4.6)."""
        self.execute("FAULT_ACK")

    def align_encoder(self) -> None:
        """Aligns the encoder (4.6)."""
        self.execute("ENCODER_ALIGN")

    def ramp(self, speed: float, seconds: float) -> None:
        """Goes to ``speed``, rpm, within ``seconds``: at once in RUN, else when RUN is reached (4.8).

        Rounded to 1 rpm and 1 ms; a time is 0, a step, to 65.535 s.
        """
        self._perform(Request.ramp(speed, seconds))

    def current(self, iq: float, id: float = 0.0) -> None:
        """Sets the current references (4.11); A with ``full_scale_amps``, else digits.

        No ``speed_limit`` bounds the motor then.
        """
        self._perform(Request.current(iq, id, full_scale_amps=self._full_scale_amps))

    def torque_ramp(self, iq: float, seconds: float) -> None:
        """Goes to ``iq`` within ``seconds``; A with ``full_scale_amps``, else digits.

        Of profile ``mcsdk-5.4``; for others the same bytes ask for something else. No
        ``speed_limit`` bounds the motor then.
        """
        self._only("mcsdk-5.4", "torque ramps")
        self._perform(Request.torque_ramp(iq, seconds, full_scale_amps=self._full_scale_amps))

    def move_to(self, angle_rad: float, seconds: float) -> None:
        """Turns to ``angle_rad``, rad, within ``seconds``; profile ``mcsdk-5.4`` with position control.

        Refused while there is a ``speed_limit``: the command carries no speed.
        """
        self._only("mcsdk-5.4", "moves")
        self._perform(Request.move_to(angle_rad, seconds))

    def revup(self, phase: int) -> RevupPhase:
        """A phase of the rev-up, 0 to 4 (4.9)."""
        request = Request.revup(phase, full_scale_amps=self._full_scale_amps)
        data: RevupPhase = self._perform(request)
        return data

    def set_revup(self, phase: int, speed: float, current: float, seconds: float) -> None:
        """Sets a phase of the rev-up, 0 to 4 (4.10).

        Speed, rpm, and Iq, A with ``full_scale_amps``, else digits, at the end of the phase; and how
        long it is, s.
        """
        full_scale_amps = self._full_scale_amps
        self._perform(
            Request.set_revup(phase, speed, current, seconds, full_scale_amps=full_scale_amps)
        )

    def configure_segment(self, segment: int, registers: Sequence[str | int]) -> None:
        """Chooses the registers, at most 32, of a data segment, 0 to 3 (profile ``spec``).

        The drive keeps one set of segments for all of its motors, until it is powered off.
        """
        self._only("spec", "data segments")
        request = Request.configure_segment(segment, registers)
        self._bus._segments.claim(segment)
        self._perform(request)
        self._bus._segments.chosen(segment, registers)

    def read_segment(
        self, segment: int, registers: Sequence[str | int] | None = None, *, raw: bool = False
    ) -> dict[str, float]:
        """Reads a data segment in one exchange: the registers' values by name (profile ``spec``).

        ``registers``: what it was configured with, unless it was by this bus.
        """
        self._only("spec", "data segments")
        if registers is None:
            registers = self._bus._segments.registers(segment)
        request = Request.read_segment(
            segment, registers, raw=raw, full_scale_amps=self._full_scale_amps
        )
        values: dict[str, float] = self._perform(request)
        return values

    def _only(self, profile: str, what: str) -> None:
        only(profile, what, of=self._bus.profile, port=self._bus.port, motor=self._number)

    def __repr__(self) -> str:
        return f"<motorlink.st.Motor {self._number} on {self._bus.port}>"
