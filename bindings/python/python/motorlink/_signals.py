"""SIGTERM and SIGHUP stop motors before they end the program."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack
from types import FrameType

_SIGNALS = (signal.SIGTERM, signal.SIGHUP)

#: What stops the motors of each open client.
_stops: dict[object, Callable[[], None]] = {}

#: Set when a handler has begun.
_begun = threading.Event()


def before_signals(stop: Callable[[], None]) -> Callable[[], None]:
    """Calls ``stop`` before SIGTERM or SIGHUP ends the program, until the returned function is called.

    Only the main thread can install handlers. Only the default action is replaced.
    """
    key = object()
    _stops[key] = stop
    _replace(signal.SIG_DFL, _stop_all)
    _repeater.watch()

    def release() -> None:
        _stops.pop(key, None)
        if not _stops:
            _repeater.ignore()
            _replace(_stop_all, signal.SIG_DFL)

    return release


def _replace(
    before: Callable[[int, FrameType | None], None] | signal.Handlers,
    after: Callable[[int, FrameType | None], None] | signal.Handlers,
) -> None:
    if _is_main_thread():
        for number in _SIGNALS:
            if signal.getsignal(number) == before:
                signal.signal(number, after)


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _stop_all(number: int, frame: FrameType | None) -> None:
    if _begun.is_set():
        return
    _begun.set()
    try:
        with ExitStack() as stack:
            # All of them, also if one raises. The client that was opened first is stopped first.
            for stop in reversed(tuple(_stops.values())):
                stack.callback(stop)
    finally:
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)


class _Repeater:
    """Sends a signal to the main thread again until its handler has begun.

    Python runs a handler between two steps of the main thread. If the signal comes just before a wait
    begins, or in another thread, the handler would run after the wait: the motors would keep turning.
    """

    def __init__(self) -> None:
        self._ends: tuple[socket.socket, socket.socket] | None = None

    def watch(self) -> None:
        """Watches from now on, if this is the main thread and no event loop watches already."""
        if not _is_main_thread():
            return
        if self._ends is None:
            ours, theirs = self._ends = socket.socketpair()
            theirs.setblocking(False)
            threading.Thread(target=self._run, args=(ours,), name="motorlink-signals", daemon=True).start()
            os.register_at_fork(after_in_child=self._forked)
        descriptor = self._ends[1].fileno()
        before = signal.set_wakeup_fd(descriptor, warn_on_full_buffer=False)
        if before not in (-1, descriptor):
            signal.set_wakeup_fd(before)

    def ignore(self) -> None:
        """Watches no more."""
        if self._ends is None or not _is_main_thread():
            return
        before = signal.set_wakeup_fd(-1)
        if before != self._ends[1].fileno():
            signal.set_wakeup_fd(before)

    def _forked(self) -> None:
        # The descriptor leads to the parent's thread: a signal of the child would end the parent.
        self.ignore()
        self._ends = None

    def _run(self, signals: socket.socket) -> None:
        while True:
            for number in signals.recv(64):
                while number in _SIGNALS and signal.getsignal(number) == _stop_all and not _begun.wait(0.05):
                    signal.pthread_kill(threading.main_thread().ident or 0, number)


_repeater = _Repeater()
