"""RMD motors on a CAN bus, protocol V1.62, for asyncio. See :mod:`motorlink.rmd`.

>>> import asyncio, motorlink
>>> async def main() -> float:
...     async with motorlink.aio.rmd.open("sim:") as client:
...         motor = client.motor(1)
...         await motor.set_position(90, max_speed_dps=500)
...         return (await motor.status()).voltage_volts
>>> asyncio.run(main())
24.0
"""

from __future__ import annotations

import asyncio
import functools
import os
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any, Union

from motorlink._apis import Awaited
from motorlink._core import RMD_SCAN_WIDTH, CanPort, RmdEventClient, RmdRequest, RmdSampling
from motorlink._rmd import RmdClient, ScanResult
from motorlink._rmd_motor import RmdMotor
from motorlink.aio._sampling import Sampling, sampled
from motorlink.aio._settings import Settings
from motorlink.aio._steps import AwaitedClient, Opening, is_told, opens, tell
from motorlink.errors import ClosedError, MotorlinkError, PortError

__all__ = ["Client", "Motor", "Opening", "open"]


def __dir__() -> list[str]:
    return __all__


class Motor(Awaited, RmdMotor["Client"]):
    """One motor on the bus, from :meth:`Client.motor`. See :class:`motorlink.rmd.Motor`."""

    __slots__ = ()

    @property
    def settings(self) -> Settings:
        """The settings as text: ``motor.settings.dump()``, ``diff`` and ``restore``."""
        return Settings(self)


class Client(AwaitedClient, RmdClient[Motor, Union[str, "os.PathLike[str]", CanPort], Sampling]):
    """A CAN bus with RMD motors, from :func:`open`. See :class:`motorlink.rmd.Client`.

    Tasks may share it. Exchanges with different motors overlap. A motor has one exchange at a time, in the
    order of the calls. Each task gets its own reply.
    """

    _core: RmdEventClient
    _Core = RmdEventClient
    _Motor = Motor
    _Sampling = Sampling

    def __init__(self, core: RmdEventClient, **options: Any):
        super().__init__(core, **options)
        self._turns: dict[int, asyncio.Lock] = {}
        self._answers: dict[int, asyncio.Future[Any]] = {}

    async def _exchange(self, motor: int, request: RmdRequest) -> Any:
        async with self._turn(motor):
            return await self._asked(motor, lambda: self._core.ask(motor, request))

    async def _confirm(self, motor: int) -> None:
        async with self._turn(motor):
            await self._asked(motor, lambda: self._core.begin_confirmation(motor))
            self._core.confirmed(motor)

    async def _asked(self, motor: int, begin: Callable[[], None]) -> Any:
        """One exchange, during the motor's turn."""
        await self._steps.ready()
        try:
            begin()
            answers = self._expect([motor])
            self._steps.take()
            await self._steps.turn(answers.values())
            return await answers[motor]
        finally:
            self._forget([motor])

    async def _cycle(self, requests: list[tuple[int, RmdRequest]]) -> Any:
        asked = dict(requests)
        for id, request in requests:
            self._core.check_limits(id, request)
        return await self._gather(asked, lambda id: self._core.ask(id, asked[id], patient=False))

    async def _torque4(self, iq_amps: list[float], expect: list[int]) -> Any:
        async with self._all_turns({1, 2, 3, 4, *expect}):
            await self._steps.ready()
            try:
                self._core.set_torque4(iq_amps, expect)
                return await self._answered(self._expect(expect))
            finally:
                self._forget(expect)

    async def _scan(self, ids: list[int]) -> Any:
        found: list[ScanResult] = []
        for begin in range(0, len(ids), RMD_SCAN_WIDTH):
            some = ids[begin : begin + RMD_SCAN_WIDTH]
            answers = await self._gather(some, self._core.look_for)
            for answer in answers.values():
                if isinstance(answer, MotorlinkError):
                    raise answer
                if answer is not None:
                    found.append(answer)
        return found

    async def _sample(self, sampling: RmdSampling, skip: bool, most: int | None) -> Any:
        async def carry_out() -> None:
            await self._gather(
                sampling.motors, lambda id: self._core.ask_sampling(id, sampling)
            )

        return await sampled(sampling, carry_out, skip=skip, most=most)

    async def _gather(self, ids: Iterable[int], ask: Callable[[int], None]) -> dict[int, Any]:
        """Asks each motor. Returns each reply, or why the motor was not asked, by ID."""
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
            # Always in the same order, which excludes a deadlock.
            for motor in sorted(set(motors)):
                await turns.enter_async_context(self._turn(motor))
            yield

    def _expect(self, motors: list[int]) -> dict[int, asyncio.Future[Any]]:
        answers: dict[int, asyncio.Future[Any]] = {id: self._steps.future() for id in motors}
        self._answers.update(answers)
        return answers

    async def _answered(self, answers: dict[int, asyncio.Future[Any]]) -> dict[int, Any]:
        """Waits for all replies. A port that fails is raised, as it failed for all."""
        self._steps.take()
        await self._steps.turn(answers.values())
        if answers:
            await asyncio.wait(answers.values())
        outcomes = {id: answer.exception() or answer.result() for id, answer in answers.items()}
        for outcome in outcomes.values():
            if isinstance(outcome, (PortError, ClosedError)):
                raise outcome
        return outcomes

    def _forget(self, motors: list[int]) -> None:
        """Abandons exchanges that are not complete, so that a late reply is not taken for a newer one."""
        for id in motors:
            answer = self._answers.pop(id, None)
            if answer is not None and not is_told(answer):
                self._steps.drop(functools.partial(self._core.cancel, id))

    def _advance(self) -> float | None:
        try:
            wait, over = self._core.advance()
        except PortError as error:
            self._fail(error)
            return None
        for id, value in over:
            tell(self._answers.get(id), value)
        return wait

    def _fail(self, error: MotorlinkError) -> None:
        for answer in self._answers.values():
            tell(answer, error)


open = opens(Client._open)
