"""Drives that speak ST's serial Motor Control Protocol, for asyncio. See :mod:`motorlink.st`.

>>> import asyncio, motorlink
>>> async def main() -> float:
...     async with motorlink.aio.st.open("sim:") as client:
...         motor = client.motor(1)
...         await motor.set("SPEED_KP", 1200)
...         return await motor.get("SPEED_KP")
>>> asyncio.run(main())
1200
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Sequence
from typing import Any, Union

from motorlink import _core
from motorlink._apis import Awaited, awaiting
from motorlink._core import StEventClient, StSampling, StVerifiedWrite
from motorlink._core import StRequest as Request
from motorlink._registers import RegisterNames
from motorlink._scan import Path, ScanResult, scanning
from motorlink._st import StClient
from motorlink._st_motor import StMotor
from motorlink.aio._sampling import Sampling, sampled
from motorlink.aio._settings import Settings
from motorlink.aio._steps import AwaitedClient, Opening, is_told, opens, tell
from motorlink.errors import LinkError, MotorlinkError, ReplyTimeoutError

__all__ = ["Client", "Motor", "Opening", "RegisterNames", "open", "scan"]


def __dir__() -> list[str]:
    return __all__


class Motor(Awaited, StMotor["Client"]):
    """One motor of a drive, from :meth:`Client.motor`. See :class:`motorlink.st.Motor`."""

    __slots__ = ()

    @property
    def registers(self) -> RegisterNames:
        """The names of the registers, and what each is: ``"SPEED_KP" in motor.registers``."""
        return RegisterNames(self)

    @property
    def settings(self) -> Settings:
        """The settings as text: ``motor.settings.dump()``, ``diff`` and ``restore``."""
        return Settings(self)


class Client(AwaitedClient, StClient[Motor, Union[str, "os.PathLike[str]"], Sampling]):
    """A serial line with a drive of up to seven motors, from :func:`open`. See :class:`motorlink.st.Client`.

    Tasks may share it. One exchange at a time is on the line, in the order of the calls. Each task gets its
    own reply.
    """

    _core: StEventClient
    _Core = StEventClient
    _Motor = Motor
    _Sampling = Sampling

    def __init__(self, core: StEventClient, **options: Any):
        super().__init__(core, **options)
        self._turn = asyncio.Lock()
        self._answer: asyncio.Future[Any] | None = None

    async def _exchange(self, motor: int, request: Request) -> Any:
        return await self._carry_out(lambda: self._core.begin(motor, request))

    async def _exchange_raw(self, motor: int, code: int, payload: bytes) -> Any:
        return await self._carry_out(lambda: self._core.begin_raw(motor, code, payload))

    async def _confirm(self) -> None:
        await self._carry_out(self._core.begin_confirmation)

    async def _set_verified(self, motor: int, request: Request, attempts: int) -> Any:
        write = StVerifiedWrite(motor, request, attempts, self._profile)
        attempt = None
        while attempt is None:
            try:
                told = await self._exchange(motor, write.request())
            except (LinkError, ReplyTimeoutError) as error:
                attempt = write.failed(error)
            else:
                attempt = write.answered(told)
        return attempt

    async def _sample(self, sampling: StSampling, skip: bool, most: int | None) -> Any:
        async def carry_out() -> None:
            await self._carry_out(lambda: self._core.begin_sampling(sampling))

        return await sampled(sampling, carry_out, skip=skip, most=most)

    async def _carry_out(self, begin: Callable[[], None]) -> Any:
        async with self._turn:
            await self._steps.ready()
            answer: asyncio.Future[Any] = self._steps.future()
            self._answer = answer
            try:
                begin()
                self._steps.take()
                await self._steps.turn([answer])
                return await answer
            finally:
                self._answer = None
                # A late reply must not be taken for the next caller's.
                if not is_told(answer):
                    self._steps.drop(self._core.abandon)

    def _advance(self) -> float | None:
        done, value = self._core.advance()
        if not done:
            wait: float | None = value
            return wait
        tell(self._answer, value)
        return None

    def _fail(self, error: MotorlinkError) -> None:
        tell(self._answer, error)


open = opens(Client._open)


async def scan(
    port: Path,
    rates: Sequence[int] = _core.ST_BAUD_RATES,
    *,
    timeout: float = _core.ST_SCAN_TIMEOUT,
) -> list[ScanResult]:
    """:func:`motorlink.st.scan` for asyncio. It runs in the loop's default executor."""
    loop = asyncio.get_running_loop()

    def ask(*arguments: Any) -> Any:
        return loop.run_in_executor(None, _core.st_scan_baud, *arguments)

    return await awaiting(scanning(ask, port, rates, timeout))
