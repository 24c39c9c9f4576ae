"""What buses of both protocols have in common: names of ports, and their end."""

from __future__ import annotations

import os
import warnings
import weakref
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, TypeVar, Union

from motorlink import _core
from motorlink._signals import before_signals
from motorlink.errors import BadValue, LineLost, MotorlinkError


class HasPort(Protocol):
    """What is a port without a name, such as a bench of ``motorlink.sim``."""

    @property
    def _port(self) -> _core.SimPort: ...


def _leave_ports() -> None:
    """Takes the ports of its parent from a process that was forked, which would keep them open.

    The buses own the numbers, so that these stay in use: for nothing.
    """
    descriptors = _core.open_descriptors()
    if descriptors:
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor in descriptors:
            os.dup2(nothing, descriptor, inheritable=False)
        os.close(nothing)


os.register_at_fork(after_in_child=_leave_ports)

Port = Union[str, "os.PathLike[str]", HasPort]


def opened(port: Port) -> str | _core.SimPort:
    """What the extension opens: a name, or a port that has none."""
    if isinstance(port, (str, os.PathLike)):
        return os.fspath(port)
    if not hasattr(port, "_port"):
        raise TypeError(f"{port!r} is no port: give a name, a path or a bench")
    return port._port


def opened_can(port: Port | _core.CanPort) -> str | _core.SimPort | _core.CanPort:
    """What the extension opens as a CAN bus."""
    return port if isinstance(port, _core.CanPort) else opened(port)


def on_close_checked(on_close: str, known: tuple[str, ...]) -> str:
    """What is done at the end, if it is known."""
    if on_close not in known:
        raise BadValue(f"on_close={on_close!r}: give one of {', '.join(map(repr, known))}")
    return on_close


Entered = TypeVar("Entered", bound="Ending")

#: Closes the port; gives the motors that could not be stopped before, and why.
Close = Callable[[], "list[tuple[int, MotorlinkError]]"]


def when_left_open(
    bus: object, close: Close, port: str, *, stop_on_signals: bool
) -> Callable[[], None]:
    """Closes a bus that was left open, when it is collected or the program that opened it ends.

    With ``stop_on_signals`` SIGTERM and SIGHUP are such ends, until the result is called.
    """
    owner = os.getpid()

    def end() -> None:
        if os.getpid() == owner:
            try:
                report(close(), port, in_flight=True)
            finally:
                release()

    release = before_signals(end) if stop_on_signals else lambda: None
    weakref.finalize(bus, end)
    return release


def report(failed: list[tuple[int, MotorlinkError]], port: str, *, in_flight: bool) -> None:
    """Tells of motors that could not be stopped.

    That is an exception, or a warning while another exception is on its way, which must not be hidden.
    """
    if not failed:
        return
    motors = "; ".join(f"motor {motor} may still be running: {error}" for motor, error in failed)
    if in_flight:
        warnings.warn(motors, RuntimeWarning, stacklevel=4)
        return
    raise LineLost(motors, port=port, motor=failed[0][0]) from failed[0][1]


class Ending:
    """What the blocking buses of both protocols have in common: how they end."""

    def __init__(self, close: Close, port: str, *, stop_on_signals: bool):
        self._close = close
        self._name = port
        self._release = when_left_open(self, close, port, stop_on_signals=stop_on_signals)

    @property
    def port(self) -> str:
        """The port's name."""
        return self._name

    def close(self) -> None:
        """Stops the motors that this bus set moving, as it was opened to; closes the port.

        Raises ``LineLost`` where a motor could not be stopped, which then may still be moving. The
        port is closed all the same. Exchanges of other threads that are under way are waited for.

        A bus that nobody closed is closed when it is collected, or when the program ends. In a process
        that was forked it is of no use (``Closed``), and its port is not open: that is the parent's.
        """
        self._end(in_flight=False)

    def _end(self, *, in_flight: bool) -> None:
        try:
            report(self._close(), self.port, in_flight=in_flight)
        finally:
            self._release()

    def __enter__(self: Entered) -> Entered:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end(in_flight=error is not None)


def worn(rom: bool, what: str) -> None:
    """Asks for the word that allows a write to a motor's ROM."""
    if not rom:
        raise BadValue(f"{what} goes to the motor's ROM, which wears: say rom=True")


def only(profile: str, what: str, *, of: str, port: str, motor: int) -> None:
    """Refuses what another profile than that of the bus has."""
    if of != profile:
        raise BadValue(
            f"{what} are of profile {profile}, and {port} was opened with profile {of};"
            " nothing was sent",
            port=port,
            motor=motor,
        )
