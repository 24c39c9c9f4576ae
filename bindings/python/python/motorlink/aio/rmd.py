"""RMD motors on a CAN bus, protocol V1.62, for asyncio: :mod:`motorlink.rmd`, awaited.

>>> import asyncio, motorlink
>>> async def main() -> float:
...     async with motorlink.aio.rmd.open("sim:") as bus:
...         motor = bus.motor(1)
...         await motor.move_to(90, max_speed=500)
...         return (await motor.status()).voltage_v
>>> asyncio.run(main())
24.0
"""

from __future__ import annotations

import asyncio
import functools
import os
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

from motorlink import _core
from motorlink._bus import on_close_checked, worn
from motorlink._core import CanPort
from motorlink._core import RmdRequest as Request
from motorlink._sampling import Samples, by_motor, skips
from motorlink._values import Encoder, Found, Gains, MotionStatus, MotorStatus, PhaseCurrents
from motorlink.aio._sampling import sampled
from motorlink.aio._steps import Ending, Opening, Steps, is_told, opened, port_name, tell
from motorlink.errors import Closed, MotorlinkError, PortError

__all__ = ["Bus", "Motor", "Opening", "open"]

_ON_CLOSE = ("stop", "off", "nothing")
#: IDs that a scan asks at once.
_SCAN_WIDTH = 8


def open(
    port: str | os.PathLike[str] | CanPort,
    *,
    timeout: float = 0.05,
    guard: float = 0.1,
    current_limit: float | None = None,
    speed_limit: float | None = None,
    angle_limit: float | None = None,
    on_close: str = "stop",
    stop_on_signals: bool = True,
) -> Opening[Bus]:
    """Opens a CAN bus: ``async with open(...) as bus``, or ``await open(...)``.

    The arguments are those of :func:`motorlink.rmd.open`. Nothing is sent. On SIGTERM and SIGHUP the
    motors are stopped in the main thread, with the event loop at rest; open the bus in that thread.
    """
    on_close_checked(on_close, _ON_CLOSE)
    name = port if isinstance(port, CanPort) else port_name(port)

    def machine() -> _core.RmdMachine:
        return _core.RmdMachine.open(
            name,
            timeout=timeout,
            guard=guard,
            current_limit_a=current_limit,
            speed_limit_dps=speed_limit,
            angle_limit_deg=angle_limit,
        )

    async def bus() -> Bus:
        came = await opened(machine, lambda late: late.close(stop=False, off=False))
        return Bus(came, on_close=on_close, stop_on_signals=stop_on_signals)

    return Opening(bus)


class Bus(Ending):
    """A CAN bus with RMD motors; from :func:`open`.

    Tasks may share it. Exchanges with different motors overlap; a motor has one at a time, in the order
    in which they were asked for, and each task gets its own answer.
    """

    def __init__(
        self, machine: _core.RmdMachine, *, on_close: str = "stop", stop_on_signals: bool = True
    ):
        self._machine = machine
        on_close = on_close_checked(on_close, _ON_CLOSE)
        stop, off = on_close != "nothing", on_close == "off"
        close = functools.partial(machine.close, stop=stop, off=off)
        steps, stops = Steps(machine, self._advance), stop_on_signals and stop
        super().__init__(steps, close, machine.port, stop_on_signals=stops)
        self._turns: dict[int, asyncio.Lock] = {}
        self._answers: dict[int, asyncio.Future[Any]] = {}

    @property
    def moving(self) -> list[int]:
        """IDs of the motors that this bus gave something to do and that did not stop since."""
        return self._machine.moving

    def motor(self, id: int = 1) -> Motor:
        """A motor of the bus, ID 1 to 32."""
        return Motor(self, id)

    async def perform(self, motor: int, request: Request) -> Any:
        """One exchange with a motor; gives what the request makes of the reply."""
        async with self._turn(motor):
            await self._steps.ready()
            try:
                self._machine.ask(motor, request)
                answers = self._expect([motor])
                self._steps.take()
                await self._steps.turn()
                return await answers[motor]
            finally:
                self._forget([motor])

    async def cycle(self, requests: Mapping[int, Request]) -> dict[int, Any]:
        """Asks many motors at once; the exchanges overlap. Gives what each answered, by ID.

        What fails for one motor is its answer, an exception that is not raised; what fails for the
        line is raised.
        """
        return await self._gather(
            requests, lambda id: self._machine.ask(id, requests[id], patient=False)
        )

    async def torque4(
        self,
        first: float,
        second: float,
        third: float,
        fourth: float,
        *,
        expect: Iterable[int] = (1, 2, 3, 4),
    ) -> dict[int, MotionStatus | MotorlinkError]:
        """Torque currents, A, for motors 1 to 4 in one frame (chapter 4, 0x280).

        Gives what each of the motors in ``expect`` answered; a motor that fails has an exception
        there, which is not raised. Raises ``BadValue`` beyond ±32 A or a limit; nothing is sent then.
        """
        motors = list(expect)
        async with self._all_turns({1, 2, 3, 4, *motors}):
            await self._steps.ready()
            try:
                self._machine.torque4((first, second, third, fourth), motors)
                return await self._answered(self._expect(motors))
            finally:
                self._forget(motors)

    async def scan(self, ids: Iterable[int] = range(1, 33)) -> list[Found]:
        """Asks every ID for its status; gives what answered, in the order of the IDs."""
        left = list(ids)
        found: list[Found] = []
        for begin in range(0, len(left), _SCAN_WIDTH):
            some = left[begin : begin + _SCAN_WIDTH]
            answers = await self._gather(some, self._machine.look_for)
            for answer in answers.values():
                if isinstance(answer, MotorlinkError):
                    raise answer
                if answer is not None:
                    found.append(answer)
        return found

    async def sample(
        self,
        quantities: Mapping[int, Sequence[str]] | Sequence[str],
        *,
        rate: float,
        seconds: float,
        motor: int = 1,
        raw: bool = False,
        on_error: str = "raise",
    ) -> Samples:
        """Reads what motors tell ``rate`` times a second for ``seconds``: :meth:`motorlink.rmd.Bus.sample`.

        >>> import asyncio, motorlink
        >>> async def main() -> tuple[str, ...]:
        ...     async with motorlink.aio.rmd.open("sim:") as bus:
        ...         data = await bus.sample({1: ["iq_a"], 2: ["iq_a"]}, rate=100, seconds=0.1)
        ...     return data.dtype.names
        >>> asyncio.run(main())
        ('t', 'iq_a_1', 'iq_a_2')

        Exchanges of other tasks have their turns in between. The exception that ends it early has in
        its ``samples`` what was sampled before; so has ``CancelledError``.
        """
        skip = skips(on_error)
        motors, names = by_motor(quantities, motor, str)
        sampling = _core.RmdSampling(motors, rate, seconds, raw)
        cycles = sampling.cycles

        async def row() -> None:
            answers = []
            for cycle in cycles:
                answers.append(await self.cycle(cycle))
                for answer in answers[-1].values():
                    if isinstance(answer, MotorlinkError):
                        raise answer
            sampling.push(answers)

        return await sampled(sampling, row, names, raw=raw, skip=skip)

    async def _gather(self, ids: Iterable[int], ask: Callable[[int], None]) -> dict[int, Any]:
        """Asks each motor; gives what each answered or why it was not asked, by ID."""
        motors = list(ids)
        async with self._all_turns(motors):
            await self._steps.ready()
            outcomes: dict[int, Any] = dict.fromkeys(motors)
            begun = []
            try:
                for id in motors:
                    try:
                        ask(id)
                        begun.append(id)
                    except PortError:
                        raise
                    except MotorlinkError as error:
                        outcomes[id] = error
                outcomes.update(await self._answered(self._expect(begun)))
            finally:
                self._forget(begun)
            return outcomes

    def _turn(self, motor: int) -> asyncio.Lock:
        if motor not in self._turns:
            self._turns[motor] = asyncio.Lock()
        return self._turns[motor]

    @asynccontextmanager
    async def _all_turns(self, motors: Iterable[int]) -> AsyncIterator[None]:
        async with AsyncExitStack() as turns:
            # Always in the same order, so that nobody waits for a motor in a circle.
            for motor in sorted(set(motors)):
                await turns.enter_async_context(self._turn(motor))
            yield

    def _expect(self, motors: list[int]) -> dict[int, asyncio.Future[Any]]:
        answers: dict[int, asyncio.Future[Any]] = {id: self._steps.future() for id in motors}
        self._answers.update(answers)
        return answers

    async def _answered(self, answers: dict[int, asyncio.Future[Any]]) -> dict[int, Any]:
        """Waits for all; a port that fails is raised, as it failed for every one."""
        self._steps.take()
        await self._steps.turn()
        if answers:
            await asyncio.wait(answers.values())
        outcomes = {id: answer.exception() or answer.result() for id, answer in answers.items()}
        for outcome in outcomes.values():
            if isinstance(outcome, (PortError, Closed)):
                raise outcome
        return outcomes

    def _forget(self, motors: list[int]) -> None:
        """An exchange that is not over is given up: a late reply is not the next caller's."""
        for id in motors:
            answer = self._answers.pop(id, None)
            if answer is not None and not is_told(answer):
                self._steps.drop(functools.partial(self._machine.cancel, id))

    def _advance(self) -> float | None:
        try:
            wait, over = self._machine.advance()
        except PortError as error:
            self._fail(error)
            return None
        for id, value in over:
            tell(self._answers.get(id), value)
        return wait

    def _fail(self, error: MotorlinkError) -> None:
        for answer in self._answers.values():
            tell(answer, error)

    def __repr__(self) -> str:
        closed = ", closed" if self._steps.is_closed else ""
        return f"<motorlink.aio.rmd.Bus {self.port}{closed}>"


class Motor:
    """One motor on the bus; from :meth:`Bus.motor`. See :class:`motorlink.rmd.Motor`."""

    def __init__(self, bus: Bus, id: int):
        self._bus = bus
        self._id = _core.rmd_motor(id)

    @property
    def bus(self) -> Bus:
        """The bus."""
        return self._bus

    @property
    def id(self) -> int:
        """The motor's ID."""
        return self._id

    async def _perform(self, request: Request) -> Any:
        return await self._bus.perform(self._id, request)

    def set_limits(
        self,
        *,
        current: float | None = None,
        speed: float | None = None,
        angle: float | None = None,
    ) -> None:
        """What this motor may be told from now on, A, °/s, ° from zero; ``None`` is no limit."""
        self._bus._machine.set_limits(self._id, current, speed, angle)

    async def status(self) -> MotorStatus:
        """Temperature, supply voltage and errors (Read motor status 1 and error flag commands)."""
        status: MotorStatus = await self._perform(Request.read_status())
        return status

    async def motion(self) -> MotionStatus:
        """Temperature, torque current, speed and encoder position (Read motor status 2)."""
        status: MotionStatus = await self._perform(Request.read_motion())
        return status

    async def phase_currents(self) -> PhaseCurrents:
        """The three phase currents, A (Read motor status 3)."""
        currents: PhaseCurrents = await self._perform(Request.read_phase_currents())
        return currents

    async def angle(self) -> float:
        """The angle over all turns, ° (Read multi turns angle command)."""
        angle: float = await self._perform(Request.read_angle())
        return angle

    async def circle_angle(self) -> float:
        """The angle within the turn, 0 to 359.99 ° (Read single circle angle command)."""
        angle: float = await self._perform(Request.read_circle_angle())
        return angle

    async def encoder(self) -> Encoder:
        """What the encoder reads, in counts (Read encoder data command)."""
        encoder: Encoder = await self._perform(Request.read_encoder())
        return encoder

    async def clear_errors(self) -> MotorStatus:
        """Clears the errors whose cause is gone; gives what is left (Clear motor error flag command)."""
        status: MotorStatus = await self._perform(Request.clear_errors())
        return status

    async def torque(self, amps: float) -> MotionStatus:
        """Holds a torque current, within ±32 A (Torque current control command)."""
        status: MotionStatus = await self._perform(Request.torque(amps))
        return status

    async def speed(self, dps: float) -> MotionStatus:
        """Holds a speed, °/s (Speed control command)."""
        status: MotionStatus = await self._perform(Request.speed(dps))
        return status

    async def move_to(self, degrees: float, max_speed: float | None = None) -> MotionStatus:
        """Turns to an angle over all turns, °, no faster than ``max_speed``, °/s.

        ``max_speed`` is 1 at least and is rounded down to whole °/s.
        """
        status: MotionStatus = await self._perform(Request.move_to(degrees, max_speed))
        return status

    async def turn_to(
        self,
        degrees: float,
        max_speed: float | None = None,
        *,
        clockwise: bool = True,
        full_turn: bool = False,
        tolerance: float = 0.5,
    ) -> MotionStatus:
        """Turns to an angle within the turn, 0 to 359.99 °, this way round.

        No faster than ``max_speed``, °/s, 1 at least, rounded down. The motor is asked for its angle
        first: see :meth:`motorlink.rmd.Motor.turn_to`.
        """
        request = Request.turn_to(degrees, max_speed, clockwise=clockwise)
        if not full_turn:
            request.check_full_turn(self._id, await self.circle_angle(), tolerance)
        status: MotionStatus = await self._perform(request)
        return status

    async def off(self) -> None:
        """Switches the motor off; it forgets what it was doing (Motor off command)."""
        await self._perform(Request.off())

    async def stop(self) -> None:
        """Stops the motor; it holds still and remembers what it was doing (Motor stop command)."""
        await self._perform(Request.stop())

    async def run(self) -> None:
        """Resumes what :meth:`stop` stopped (Motor running command)."""
        await self._perform(Request.run())

    async def gains(self) -> Gains:
        """The gains in RAM (Read PID parameter command)."""
        gains: Gains = await self._perform(Request.read_gains())
        return gains

    async def write_gains(self, gains: Gains, *, rom: bool = False) -> None:
        """Sets the gains until power-off, or with ``rom=True`` for good, which wears the ROM."""
        await self._perform(Request.write_gains(*gains, rom=rom))

    async def acceleration(self) -> int:
        """The acceleration limit, °/s²; 0 is none (0x33)."""
        limit: int = await self._perform(Request.read_acceleration())
        return limit

    async def write_acceleration(self, dps2: float) -> None:
        """Sets the acceleration limit until power-off, °/s² (0x34)."""
        await self._perform(Request.write_acceleration(dps2))

    async def write_encoder_offset(self, counts: int, *, rom: bool) -> int:
        """Sets the encoder's zero, in counts, at once and for good, which wears the ROM: ``rom=True``."""
        worn(rom, "the encoder offset")
        offset: int = await self._perform(Request.write_encoder_offset_to_rom(counts))
        return offset

    async def write_zero(self, *, rom: bool) -> int:
        """Makes the position the zero from the next power-on on, which wears the ROM: ``rom=True``."""
        worn(rom, "the zero")
        offset: int = await self._perform(Request.write_zero_to_rom())
        return offset

    async def exchange_raw(self, data: bytes, *, rom: bool = False) -> bytes:
        """One exchange with any eight bytes; ``rom=True`` allows those that wear the ROM."""
        reply: bytes = await self._perform(Request.raw(data, rom=rom))
        return reply

    def __repr__(self) -> str:
        return f"<motorlink.aio.rmd.Motor {self._id} on {self._bus.port}>"
