"""What the clients of both protocols have in common: port names and closing."""

from __future__ import annotations

import contextlib
import functools
import os
import warnings
import weakref
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar, Union

from motorlink import _core
from motorlink._apis import Blocking, Exchanges, Function, both_apis, carried_out, described
from motorlink._signals import before_signals
from motorlink.errors import InvalidValueError, LinkError, MotorlinkError

if TYPE_CHECKING:
    from typing_extensions import ParamSpec, Self

    Arguments = ParamSpec("Arguments")

Opened = TypeVar("Opened", bound="AnyClient")


class HasPort(Protocol):
    """A port without a name, such as a bench of ``motorlink.sim``."""

    @property
    def _port(self) -> _core.SimPort: ...


def _leave_ports() -> None:
    """Closes the parent's ports in a forked process, which would keep them open.

    The parent's clients still own the descriptor numbers, so the numbers stay in use, for /dev/null.
    """
    descriptors = _core.open_descriptors()
    if descriptors:
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor in descriptors:
            os.dup2(nothing, descriptor, inheritable=False)
        os.close(nothing)


os.register_at_fork(after_in_child=_leave_ports)

PortLike = Union[str, "os.PathLike[str]", HasPort]


def opened(port: PortLike) -> str | _core.SimPort:
    """What the extension opens: a name, or a port without a name."""
    if isinstance(port, (str, os.PathLike)):
        return os.fspath(port)
    if not hasattr(port, "_port"):
        raise TypeError(f"{port!r} is not a port: give a name, a path or a bench")
    return port._port


#: Closes the port. Returns the motors that could not be stopped, and why.
Close = Callable[[], "list[tuple[int, MotorlinkError]]"]


def when_left_open(
    client: AnyClient, close: Close, port: str, *, stop_on_signals: bool
) -> Callable[[], None]:
    """Closes a client that was left open, when it is garbage-collected or its program ends.

    With ``stop_on_signals`` SIGTERM and SIGHUP close it too, until the returned function is called.
    """
    owner = os.getpid()

    def end() -> None:
        if os.getpid() == owner:
            try:
                report(close(), port, in_flight=True)
            finally:
                release()

    release = before_signals(end) if stop_on_signals else lambda: None
    _left_open[client] = weakref.finalize(client, end)
    return release


#: What closes each client that was not garbage-collected.
_left_open: weakref.WeakKeyDictionary[AnyClient, weakref.finalize[..., Any]] = (
    weakref.WeakKeyDictionary()
)


def close_left_open() -> None:
    """Closes the clients that were left open, as the end of the program does."""
    for close in list(_left_open.values()):
        close()


def is_any_moving() -> bool:
    """Whether a client of this program has a motor that moves."""
    for client in list(_left_open):
        with contextlib.suppress(MotorlinkError):
            if client._core.moving:
                return True
    return False


def report(failed: list[tuple[int, MotorlinkError]], port: str, *, in_flight: bool) -> None:
    """Reports motors that could not be stopped.

    It raises, or warns while another exception is raised, which would be hidden.
    """
    if not failed:
        return
    motors = "; ".join(f"motor {motor} may still be running: {error}" for motor, error in failed)
    if in_flight:
        warnings.warn(motors, RuntimeWarning, stacklevel=4)
        return
    raise LinkError(motors, port=port, motor=failed[0][0]) from failed[0][1]


class Closing:
    """An object that the end of ``with`` closes."""

    def _end(self, *, in_flight: bool) -> Any:
        """Closes it. ``in_flight``: an exception is being raised."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end(in_flight=error is not None)


class AnyClient:
    """What the clients of both protocols and both APIs have in common: opening and closing."""

    #: The values of ``on_close``, and the arguments for closing the client.
    _ENDS: ClassVar[dict[str, dict[str, bool]]]
    #: The client of the extension module, and its class.
    _core: Any
    _Core: ClassVar[Any]
    # Of each API: what the extension opens, the exchange that opens it, and the one that closes it.
    _named: Any
    _opened: Any
    _end: Any
    _is_closed: Any

    def __init__(self, core: Any, *, on_close: str, stop_on_signals: bool):
        ends = self._ends(on_close)
        self._core = core
        core.end_with(**ends)
        self._close: Close = functools.partial(core.close, **ends)
        self._name: str = core.port
        #: Motors whose settings are being restored.
        self._restored: dict[int, object] = {}
        self._release = when_left_open(
            self, self._close, self._name, stop_on_signals=stop_on_signals and ends["stop"]
        )

    @classmethod
    def _opening(
        cls, core: Callable[[], Any], *, on_close: str, **options: Any
    ) -> Callable[[], Exchanges[Self]]:
        """A function that opens a client of the extension, and then the client of the API."""
        cls._ends(on_close)

        def client() -> Exchanges[Self]:
            opened = yield cls._opened(core)
            return cls(opened, on_close=on_close, **options)

        return client

    @classmethod
    def _ends(cls, on_close: str) -> dict[str, bool]:
        if on_close not in cls._ENDS:
            known = ", ".join(map(repr, cls._ENDS))
            raise InvalidValueError(f"on_close={on_close!r}: give one of {known}")
        return cls._ENDS[on_close]

    @property
    def port(self) -> str:
        """The port's name."""
        return self._name

    @both_apis
    def close(self) -> Exchanges[None]:
        """Stops the motors that this client started, as ``on_close`` of ``open`` says. Closes the port.

        Exchanges of other threads are completed first. Exchanges of other tasks raise ``ClosedError``. If the
        task is cancelled meanwhile, the cancellation continues after the close. A second call does nothing.

        A client that is left open is closed when it is garbage-collected, or when the program ends. In a
        forked process a client of the parent raises ``ClosedError``: the port belongs to the parent.

        Raises ``LinkError`` if a motor could not be stopped. The motor may still turn. The port is closed.
        """
        yield self._end(in_flight=False)

    def _text(self, more: str = "") -> str:
        closed = ", closed" if self._is_closed else ""
        return f"<{type(self).__module__}.Client {self.port}{more}{closed}>"


class BlockingClient(Closing, Blocking, AnyClient):
    """What the blocking clients of both protocols have in common."""

    _named = staticmethod(opened)

    @classmethod
    def _opened(cls, core: Callable[[], Any]) -> Any:
        return core()

    def _end(self, *, in_flight: bool) -> None:
        try:
            report(self._close(), self.port, in_flight=in_flight)
        finally:
            self._release()

    @property
    def _is_closed(self) -> bool:
        return bool(self._core.is_closed)

    def _now(self) -> float:
        now: float = self._core.now
        return now

    def _pause(self, seconds: float) -> None:
        self._core.pause(seconds)


def opens(
    opening: Callable[Arguments, Callable[[], Exchanges[Opened]]],
) -> Callable[Arguments, Opened]:
    """The function ``open`` of a protocol."""

    def open(*arguments: Arguments.args, **named: Arguments.kwargs) -> Opened:
        return carried_out(opening(*arguments, **named)())

    return open_described(open, opening, "Client")


def open_described(open: Function, opening: Callable[..., object], returned: str) -> Function:
    """The function ``open`` of a protocol and an API with its arguments and docstring."""
    described(open, opening, returned)
    open.__name__ = open.__qualname__ = "open"
    open.__module__ = opening.__self__.__module__  # type: ignore[attr-defined]
    return open
