"""SIGTERM and SIGHUP stop motors before they end the program."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from contextlib import ExitStack
from types import FrameType

_SIGNALS = (signal.SIGTERM, signal.SIGHUP)

#: What stops the motors of each open client.
_stops: dict[object, Callable[[], None]] = {}


def before_signals(stop: Callable[[], None]) -> Callable[[], None]:
    """Calls ``stop`` before SIGTERM or SIGHUP ends the program, until the returned function is called.

    Only the main thread can install handlers. Only the default action is replaced.
    """
    key = object()
    _stops[key] = stop
    _replace(signal.SIG_DFL, _stop_all)

    def release() -> None:
        _stops.pop(key, None)
        if not _stops:
            _replace(_stop_all, signal.SIG_DFL)

    return release


def _replace(
    before: Callable[[int, FrameType | None], None] | signal.Handlers,
    after: Callable[[int, FrameType | None], None] | signal.Handlers,
) -> None:
    if threading.current_thread() is threading.main_thread():
        for number in _SIGNALS:
            if signal.getsignal(number) == before:
                signal.signal(number, after)


def _stop_all(number: int, frame: FrameType | None) -> None:
    try:
        with ExitStack() as stack:
            # All of them, also if one raises. The client that was opened first is stopped first.
            for stop in reversed(tuple(_stops.values())):
                stack.callback(stop)
    finally:
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)
