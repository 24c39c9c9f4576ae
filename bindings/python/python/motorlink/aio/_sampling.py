"""Sampling in an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Protocol

from motorlink._apis import Awaited
from motorlink._sampling import AnySampling, Sample
from motorlink.errors import LinkError, ReplyTimeoutError


class Rows(Protocol):
    """The rows of both protocols, of the extension module."""

    def after(self, now: float) -> float | None: ...
    def take(self) -> tuple[bytearray, int]: ...


async def nothing() -> None:
    """The preparation of a sampling that needs none."""


async def sampled(
    rows: Rows,
    row: Callable[[], Awaitable[None]],
    *,
    skip: bool,
    most: int | None,
    prepare: Callable[[], Awaitable[None]] = nothing,
) -> tuple[bytearray, int, BaseException | None]:
    """Reads a row at each instant. Returns the new rows, the skipped instants and the error."""
    loop = asyncio.get_running_loop()
    ended: BaseException | None = None
    count = 0
    try:
        await prepare()
        while count != most and (wait := rows.after(loop.time())) is not None:
            if wait:
                await asyncio.sleep(wait)
                continue
            try:
                await row()
                count += 1
            except (LinkError, ReplyTimeoutError):
                if not skip:
                    raise
    except BaseException as error:
        ended = error
    return (*rows.take(), ended)


class Sampling(Awaited, AnySampling):
    """Rows of ``client.samples``, read one after the other: ``async for row in ...``.

    Each row is a :class:`motorlink.Sample`.
    """

    def __aiter__(self) -> Sampling:
        return self

    async def __anext__(self) -> Sample:
        row = await self._row()
        if row is None:
            raise StopAsyncIteration
        return row
