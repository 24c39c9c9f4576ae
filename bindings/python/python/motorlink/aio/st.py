"""Drives that speak ST's serial Motor Control Protocol, for asyncio: :mod:`motorlink.st`, awaited.

>>> import asyncio, motorlink
>>> async def main() -> float:
...     async with motorlink.aio.st.open("sim:") as bus:
...         motor = bus.motor(1)
...         await motor.write("SPEED_KP", 1200)
...         return await motor.read("SPEED_KP")
>>> asyncio.run(main())
1200
"""

from __future__ import annotations

import asyncio
import functools
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from motorlink import _core
from motorlink._bus import on_close_checked, only
from motorlink._core import StRequest as Request
from motorlink._registers import RegisterNames
from motorlink._sampling import Samples, by_motor, skips
from motorlink._segments import Segments
from motorlink._values import ControlMode, Faults, FirmwareVersion, Info, RevupPhase, State
from motorlink.aio._sampling import sampled
from motorlink.aio._steps import Ending, Opening, Steps, is_told, opened, port_name, tell
from motorlink.errors import LineLost, MotorlinkError, Refused, Timeout

__all__ = ["Bus", "Motor", "Opening", "open"]

_ON_CLOSE = ("stop", "nothing")


def open(
    port: str | os.PathLike[str],
    *,
    profile: str = "spec",
    timeout: float = 1.0,
    speed_limit: float | None = None,
    current_limit: float | None = None,
    full_scale_amps: float | None = None,
    recovery: str = "drain",
    on_close: str = "stop",
    stop_on_signals: bool = True,
) -> Opening[Bus]:
    """Opens a serial line with a drive: ``async with open(...) as bus``, or ``await open(...)``.

    The arguments are those of :func:`motorlink.st.open`. Nothing is sent. On SIGTERM and SIGHUP the
    motors are stopped in the main thread, with the event loop at rest; open the bus in that thread.
    """
    on_close_checked(on_close, _ON_CLOSE)
    name = port_name(port)

    def machine() -> _core.StMachine:
        return _core.StMachine.open(
            name,
            profile=profile,
            timeout=timeout,
            recovery=recovery,
            speed_limit=speed_limit,
            current_limit=current_limit,
            full_scale_amps=full_scale_amps,
        )

    async def bus() -> Bus:
        came = await opened(machine, lambda late: late.close(stop=False))
        return Bus(
            came,
            profile=profile,
            full_scale_amps=full_scale_amps,
            on_close=on_close,
            stop_on_signals=stop_on_signals,
        )

    return Opening(bus)


class Bus(Ending):
    """A serial line with a drive of up to seven motors; from :func:`open`.

    Tasks may share it: one exchange at a time is on the line, in the order in which they were asked
    for, and each task gets its own answer.
    """

    def __init__(
        self,
        machine: _core.StMachine,
        *,
        profile: str = "spec",
        full_scale_amps: float | None = None,
        on_close: str = "stop",
        stop_on_signals: bool = True,
    ):
        self._machine = machine
        self._profile = profile
        self._full_scale_amps = full_scale_amps
        stop = on_close_checked(on_close, _ON_CLOSE) == "stop"
        close = functools.partial(machine.close, stop=stop)
        steps, stops = Steps(machine, self._advance), stop_on_signals and stop
        super().__init__(steps, close, machine.port, stop_on_signals=stops)
        self._turn = asyncio.Lock()
        self._answer: asyncio.Future[Any] | None = None
        self._segments = Segments()

    @property
    def profile(self) -> str:
        """``spec`` or ``mcsdk-5.4``."""
        return self._profile

    @property
    def started(self) -> list[int]:
        """Numbers of the motors that this bus started and did not stop."""
        return self._machine.started

    def motor(self, number: int = 1, *, full_scale_amps: float | None = None) -> Motor:
        """A motor of the drive, 1 to 7; 0 is whichever the drive has selected (TARGET_MOTOR)."""
        if full_scale_amps is None:
            full_scale_amps = self._full_scale_amps
        return Motor(self, number, full_scale_amps)

    async def info(self) -> Info:
        """Version and name of the SDK (4.7)."""
        info: Info = await self.perform(0, Request.info())
        return info

    async def firmware_version(self) -> FirmwareVersion:
        """Name and version of the firmware (4.12)."""
        version: FirmwareVersion = await self.perform(0, Request.firmware_version())
        return version

    async def perform(self, motor: int, request: Request) -> Any:
        """One exchange with a motor; gives what the request makes of the reply."""
        return await self._exchange(lambda: self._machine.begin(motor, request))

    async def exchange_raw(self, code: int, payload: bytes = b"", *, motor: int = 0) -> bytes:
        """One exchange with any frame code, 0 to 0x1f, and payload; gives the payload of the answer."""
        begin = self._machine.begin_raw
        reply: bytes = await self._exchange(lambda: begin(motor, code, payload))
        return reply

    async def sample(
        self,
        registers: Sequence[str | int] | Mapping[int, Sequence[str | int]],
        *,
        rate: float,
        seconds: float,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> Samples:
        """Reads registers ``rate`` times a second for ``seconds``: :meth:`motorlink.st.Bus.sample`.

        >>> import asyncio, motorlink
        >>> async def main() -> tuple[str, ...]:
        ...     async with motorlink.aio.st.open("sim:") as bus:
        ...         data = await bus.sample(["SPEED_MEAS", "BUS_VOLTAGE"], rate=100, seconds=0.1)
        ...     return data.dtype.names
        >>> asyncio.run(main())
        ('t', 'SPEED_MEAS', 'BUS_VOLTAGE')

        Exchanges of other tasks have their turns in between. The exception that ends it early has in
        its ``samples`` what was sampled before; so has ``CancelledError``.
        """
        skip = skips(on_error)
        wanted, names = by_motor(registers, motor, _core.st_register_name)
        motors = [(number, some, self._full_scale_amps) for number, some in wanted]
        with self._segments.for_sampling(len(motors)) as segments:
            sampling = _core.StSampling(self._profile, motors, segments, rate, seconds, raw)

            async def carry_out() -> None:
                while (asked := sampling.request()) is not None:
                    try:
                        value = await self.perform(*asked)
                    except Refused:
                        if not sampling.refused():
                            raise
                    else:
                        sampling.answered(value)

            async def row() -> None:
                await carry_out()
                sampling.push()

            return await sampled(sampling, row, names, raw=raw, skip=skip, prepare=carry_out)

    async def _exchange(self, begin: Callable[[], None]) -> Any:
        async with self._turn:
            await self._steps.ready()
            answer: asyncio.Future[Any] = self._steps.future()
            self._answer = answer
            try:
                begin()
                self._steps.take()
                await self._steps.turn()
                return await answer
            finally:
                self._answer = None
                # A late reply is not the next caller's.
                if not is_told(answer):
                    self._steps.drop(self._machine.abandon)

    def _advance(self) -> float | None:
        done, value = self._machine.advance()
        if not done:
            wait: float | None = value
            return wait
        tell(self._answer, value)
        return None

    def _fail(self, error: MotorlinkError) -> None:
        tell(self._answer, error)

    def __repr__(self) -> str:
        closed = ", closed" if self._steps.is_closed else ""
        return f"<motorlink.aio.st.Bus {self.port}, profile {self._profile}{closed}>"


class Motor:
    """One motor of a drive; from :meth:`Bus.motor`. See :class:`motorlink.st.Motor`."""

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
    def registers(self) -> RegisterNames:
        """The names of the registers, and what each is: ``"SPEED_KP" in motor.registers``."""
        return RegisterNames(self)

    async def _perform(self, request: Request) -> Any:
        return await self._bus.perform(self._number, request)

    async def read(self, register: str | int, *, raw: bool = False) -> float:
        """Reads a register (4.5), in its unit, or in digits with ``raw=True``."""
        request = self._reads.get((register, raw))
        if request is None:
            request = Request.read(
                register,
                profile=self._bus.profile,
                raw=raw,
                full_scale_amps=self._full_scale_amps,
            )
            self._reads[register, raw] = request
        value: float = await self._bus.perform(self._number, request)
        return value

    async def write(self, register: str | int, value: float | str, *, raw: bool = False) -> None:
        """Writes a register (4.4), in its unit, or in digits with ``raw=True``."""
        await self._perform(self._write(register, value, raw))

    async def write_verified(
        self, register: str | int, value: float | str, *, raw: bool = False, attempts: int = 3
    ) -> int:
        """Writes a register, reads it back, and repeats both until it has the value.

        Gives the number of the attempt that did it; see :meth:`motorlink.st.Motor.write_verified`.
        What another task writes to the register in between is found, and written over.
        """
        request = self._write(register, value, raw)
        write = _core.StVerifiedWrite(self._number, request, attempts, self._bus.profile)
        attempt = None
        while attempt is None:
            try:
                told = await self._perform(write.request())
            except (LineLost, Timeout) as error:
                attempt = write.failed(error)
            else:
                attempt = write.answered(told)
        return attempt

    def _write(self, register: str | int, value: float | str, raw: bool) -> Request:
        return Request.write(
            register,
            value,
            profile=self._bus.profile,
            raw=raw,
            full_scale_amps=self._full_scale_amps,
        )

    async def status(self) -> State:
        """The state of its state machine, in words: ``IDLE``, ``RUN``, ``FAULT_NOW`` (STATUS)."""
        state: State = await self._perform(Request.state())
        return state

    async def faults(self) -> Faults:
        """Its faults (FLAGS); false when there are none."""
        faults: Faults = await self._perform(Request.faults())
        return faults

    async def control_mode(self) -> ControlMode:
        """``TORQUE`` or ``SPEED`` (CONTROL_MODE)."""
        mode: ControlMode = await self._perform(Request.control_mode())
        return mode

    async def execute(self, command: str | int) -> None:
        """Executes a command by its name in table 4, such as ``PFC_ENABLE``, or its number (4.6)."""
        await self._perform(Request.execute(command))

    async def start(self) -> None:
        """Starts the motor (4.6). With a fault pending the drive acknowledges and does nothing.

        With a ``speed_limit``, call :meth:`ramp` before: the drive may have a target of its own.
        """
        await self.execute("START_MOTOR")

    async def stop(self) -> None:
        """Stops the motor (4.6)."""
        await self.execute("STOP_MOTOR")

    async def stop_ramp(self) -> None:
        """Stops the ramp that is executing; the speed stays (4.6)."""
        await self.execute("STOP_RAMP")

    async def acknowledge_faults(self) -> None:
        """Acknowledges faults whose cause is gone (4.6)."""
        await self.execute("FAULT_ACK")

    async def align_encoder(self) -> None:
        """Aligns the encoder (4.6)."""
        await self.execute("ENCODER_ALIGN")

    async def ramp(self, speed: float, seconds: float) -> None:
        """Goes to ``speed``, rpm, within ``seconds``: at once in RUN, else when RUN is reached (4.8)."""
        await self._perform(Request.ramp(speed, seconds))

    async def current(self, iq: float, id: float = 0.0) -> None:
        """Sets the current references (4.11); A with ``full_scale_amps``, else digits."""
        await self._perform(Request.current(iq, id, full_scale_amps=self._full_scale_amps))

    async def torque_ramp(self, iq: float, seconds: float) -> None:
        """Goes to ``iq`` within ``seconds``; profile ``mcsdk-5.4``."""
        self._only("mcsdk-5.4", "torque ramps")
        await self._perform(Request.torque_ramp(iq, seconds, full_scale_amps=self._full_scale_amps))

    async def move_to(self, angle_rad: float, seconds: float) -> None:
        """Turns to ``angle_rad``, rad, within ``seconds``; profile ``mcsdk-5.4`` with position control.

        Refused while there is a ``speed_limit``: the command carries no speed.
        """
        self._only("mcsdk-5.4", "moves")
        await self._perform(Request.move_to(angle_rad, seconds))

    async def revup(self, phase: int) -> RevupPhase:
        """A phase of the rev-up, 0 to 4 (4.9)."""
        request = Request.revup(phase, full_scale_amps=self._full_scale_amps)
        data: RevupPhase = await self._perform(request)
        return data

    async def set_revup(self, phase: int, speed: float, current: float, seconds: float) -> None:
        """Sets a phase of the rev-up, 0 to 4 (4.10)."""
        full_scale_amps = self._full_scale_amps
        await self._perform(
            Request.set_revup(phase, speed, current, seconds, full_scale_amps=full_scale_amps)
        )

    async def configure_segment(self, segment: int, registers: Sequence[str | int]) -> None:
        """Chooses the registers, at most 32, of a data segment, 0 to 3 (profile ``spec``)."""
        self._only("spec", "data segments")
        request = Request.configure_segment(segment, registers)
        self._bus._segments.claim(segment)
        await self._perform(request)
        self._bus._segments.chosen(segment, registers)

    async def read_segment(
        self, segment: int, registers: Sequence[str | int] | None = None, *, raw: bool = False
    ) -> dict[str, float]:
        """Reads a data segment in one exchange: the registers' values by name (profile ``spec``)."""
        self._only("spec", "data segments")
        if registers is None:
            registers = self._bus._segments.registers(segment)
        request = Request.read_segment(
            segment, registers, raw=raw, full_scale_amps=self._full_scale_amps
        )
        values: dict[str, float] = await self._perform(request)
        return values

    def _only(self, profile: str, what: str) -> None:
        only(profile, what, of=self._bus.profile, port=self._bus.port, motor=self._number)

    def __repr__(self) -> str:
        return f"<motorlink.aio.st.Motor {self._number} on {self._bus.port}>"
