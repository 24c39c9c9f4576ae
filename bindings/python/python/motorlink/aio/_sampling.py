"""Sampling in an event loop: the rows of ``client.sample``, awaited."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Protocol

from motorlink.errors import LinkError, ReplyTimeoutError


class Sampling(Protocol):
    """What samplings of both protocols have in common."""

    def after(self, since: float) -> float | None: ...
    def rows(self) -> bytearray: ...


async def nothing() -> None:
    """What is done before the first row where there is nothing to do."""


async def sampled(
    sampling: Sampling,
    row: Callable[[], Awaitable[None]],
    *,
    skip: bool,
    prepare: Callable[[], Awaitable[None]] = nothing,
) -> tuple[bytearray, BaseException | None]:
    """Takes a row at each instant; gives the rows, and what ended them early."""
    loop = asyncio.get_running_loop()
    ended: BaseException | None = None
    try:
        await prepare()
        began = loop.time()
        while (wait := sampling.after(loop.time() - began)) is not None:
            if wait:
                await asyncio.sleep(wait)
                continue
            try:
                await row()
            except (LinkError, ReplyTimeoutError):
                if not skip:
                    raise
    except BaseException as error:
        ended = error
    return sampling.rows(), ended
