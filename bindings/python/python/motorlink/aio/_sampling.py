"""Sampling in an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Protocol

from motorlink._apis import Awaited
from motorlink._sampling import AnySampling, Sample
from motorlink.errors import LinkError, ReplyTimeoutError


class Rows(Protocol):
    """A sampling of either protocol, of the extension module."""

    def begin(self, most: int | None) -> None: ...
    def next(self, skip: bool, most: int | None) -> float | None: ...
    def fail(self) -> None: ...
    def take(self) -> tuple[bytearray, int]: ...


async def sampled(
    rows: Rows, carry_out: Callable[[], Awaitable[None]], *, skip: bool, most: int | None
) -> tuple[bytearray, int, BaseException | None]:
    """Drives a sampling. Returns the new rows, the skipped instants and the error.

    ``carry_out`` carries out the pending exchanges. It raises only errors of the port.
    """
    ended: BaseException | None = None
    try:
        rows.begin(most)
        while (wait := rows.next(skip, most)) is not None:
            if wait:
                await asyncio.sleep(wait)
                continue
            try:
                await carry_out()
            except (LinkError, ReplyTimeoutError):
                if not skip:
                    raise
                rows.fail()
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
