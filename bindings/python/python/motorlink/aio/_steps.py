"""Drives a client of the extension module in an event loop."""

from __future__ import annotations

import asyncio
import functools
import os
from collections.abc import Callable, Coroutine, Generator, Iterable
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from motorlink._apis import Awaited, Exchanges, awaiting
from motorlink._client import AnyClient, open_described, report
from motorlink.errors import ClosedError, MotorlinkError

Value = TypeVar("Value")
Entered = TypeVar("Entered", bound="AwaitedClient")

if TYPE_CHECKING:
    from typing_extensions import ParamSpec, Self

    Arguments = ParamSpec("Arguments")


def port_name(port: str | os.PathLike[str]) -> str:
    """The port as the library names it."""
    if isinstance(port, (str, os.PathLike)):
        return os.fspath(port)
    raise TypeError(
        f"{port!r} is not a port for asyncio, which uses real time: give a name or a path; `bench.serve`"
        " of motorlink.sim gives a bench such names"
    )


class Machine(Protocol):
    """What the clients of both protocols have in common."""

    @property
    def is_open(self) -> bool: ...
    @property
    def port(self) -> str: ...
    def reopen(self) -> None: ...
    def fileno(self) -> int | None: ...


class Steps:
    """Advances a client when its port has data and when its timer expires.

    ``advance`` does what it can without waiting. It returns the time until the next step, s.
    """

    def __init__(self, machine: Machine, advance: Callable[[], float | None]):
        self._loop = asyncio.get_running_loop()
        self._machine = machine
        self._advance = advance
        self._watched: int | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._opening: asyncio.Future[None] | None = None
        self.is_closed = False
        self.watch()

    def future(self) -> asyncio.Future[Value]:
        """The future of an exchange."""
        return self._loop.create_future()

    async def ready(self) -> None:
        """Opens the port again if it was lost. Raises if that fails or is not due yet."""
        if asyncio.get_running_loop() is not self._loop:
            raise RuntimeError(f"{self._machine.port} belongs to another event loop")
        while not self.is_closed:
            opening = self._opening
            if opening is None:
                if self._machine.is_open:
                    return
                opening = self._loop.run_in_executor(None, self._machine.reopen)
                opening.add_done_callback(self._opened)
                self._opening = opening
            # Other tasks may wait for it too.
            await asyncio.shield(opening)
        raise self.closed()

    def closed(self) -> ClosedError:
        """The error of calls after the close."""
        port = self._machine.port
        return ClosedError(f"{port} was closed by this program; open it again", port=port)

    def _opened(self, opening: asyncio.Future[None]) -> None:
        self._opening = None
        # Tasks that wait get the exception. Without any, asyncio would report it as unused.
        if not opening.cancelled():
            opening.exception()
        if not self.is_closed:
            self.watch()

    def watch(self) -> None:
        """Watches the client's current descriptor only."""
        descriptor = self._machine.fileno()
        if descriptor == self._watched:
            return
        self._unwatch()
        if descriptor is not None:
            self._loop.add_reader(descriptor, self.take)
            self._watched = descriptor

    def _unwatch(self) -> None:
        if self._watched is not None:
            self._loop.remove_reader(self._watched)
            self._watched = None

    async def turn(self, answers: Iterable[asyncio.Future[Any]]) -> None:
        """Lets other tasks run, and a cancellation come, if the port has replied without waiting."""
        if all(answer.done() for answer in answers):
            await asyncio.sleep(0)

    def drop(self, give_up: Callable[[], None]) -> None:
        """Abandons an exchange, unless its port is closed."""
        if not self.is_closed and self._opening is None:
            give_up()

    def take(self) -> None:
        """Takes the steps that are due."""
        if self.is_closed or self._opening is not None:
            return
        wait = self._advance()
        if not self._machine.is_open:
            self.watch()
        if wait is None:
            return
        due = self._loop.time() + wait
        if self._timer is not None:
            # An earlier timer checks again. So most exchanges need no timer of their own.
            if self._timer.when() <= due:
                return
            self._timer.cancel()
        self._timer = self._loop.call_at(due, self._due)

    def _due(self) -> None:
        self._timer = None
        self.take()

    async def close(
        self, close: Callable[[], Value]
    ) -> tuple[Value, asyncio.CancelledError | None]:
        """Takes no more steps and closes the client, also if this task is cancelled meanwhile.

        Returns the result of ``close``, and a cancellation that must continue.
        """
        self.is_closed = True
        self._unwatch()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        closing = self._loop.run_in_executor(None, close)
        cancelled = None
        while not closing.done():
            try:
                await asyncio.wait({closing})
            except asyncio.CancelledError as error:
                cancelled = error
        return closing.result(), cancelled


class AwaitedClient(Awaited, AnyClient):
    """What the clients of both protocols have in common."""

    _named = staticmethod(port_name)

    def __init__(self, core: Any, **options: Any):
        self._steps = Steps(core, self._advance)
        super().__init__(core, **options)

    @classmethod
    async def _opened(cls, core: Callable[[], Any]) -> Any:
        """Opens in another thread. If the task is cancelled meanwhile, the opened client is closed."""
        loop = asyncio.get_running_loop()
        opening = loop.run_in_executor(None, core)
        try:
            return await asyncio.shield(opening)
        except asyncio.CancelledError:

            def came(opening: asyncio.Future[Any]) -> None:
                if not opening.cancelled() and opening.exception() is None:
                    close = functools.partial(opening.result().close, **cls._ends("nothing"))
                    loop.run_in_executor(None, close)

            opening.add_done_callback(came)
            raise

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    async def _pause(self, seconds: float) -> None:
        await asyncio.sleep(seconds)

    async def _end(self, *, in_flight: bool) -> None:
        self._fail(self._steps.closed())
        failed, cancelled = await self._steps.close(self._close)
        self._release()
        report(failed, self.port, in_flight=in_flight or cancelled is not None)
        if cancelled is not None:
            raise cancelled

    def _advance(self) -> float | None:
        """Does what it can without waiting. Returns the time until the next step, s."""
        raise NotImplementedError

    def _fail(self, error: MotorlinkError) -> None:
        """Ends the exchanges under way with an error."""
        raise NotImplementedError

    @property
    def _is_closed(self) -> bool:
        return self._steps.is_closed

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self._end(in_flight=error is not None)


class Opening(Generic[Entered]):
    """A client to open: ``async with`` it, or ``await`` it."""

    def __init__(self, open: Callable[[], Coroutine[Any, Any, Entered]]):
        self._open = open
        self._client: Entered | None = None

    def __await__(self) -> Generator[Any, None, Entered]:
        return self._open().__await__()

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise AttributeError(
                f"the client is not open, so `{name}` is not available: write "
                "`async with ... as client`, or `client = await ...`"
            )

    async def __aenter__(self) -> Entered:
        self._client = await self._open()
        return self._client

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._client is not None:
            await self._client.__aexit__(kind, error, traceback)


def opens(
    opening: Callable[Arguments, Callable[[], Exchanges[Entered]]],
) -> Callable[Arguments, Opening[Entered]]:
    """The function ``open`` of a protocol."""

    def open(*arguments: Arguments.args, **named: Arguments.kwargs) -> Opening[Entered]:
        client = opening(*arguments, **named)
        return Opening(lambda: awaiting(client()))

    return open_described(open, opening, "Opening[Client]")


def tell(answer: asyncio.Future[Any] | None, value: Any) -> None:
    """Ends an exchange with a value or an exception, unless it is cancelled or complete."""
    if answer is None or answer.done():
        return
    if isinstance(value, BaseException):
        answer.set_exception(value)
    else:
        answer.set_result(value)


def is_told(answer: asyncio.Future[Any]) -> bool:
    """Whether an exchange is complete, also if its task was cancelled."""
    if not answer.done() or answer.cancelled():
        return False
    answer.exception()
    return True
