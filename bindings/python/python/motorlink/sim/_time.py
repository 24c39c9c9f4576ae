"""The clocks of ``time`` on virtual time."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def patched_time(now_ns: Callable[[], int], sleep: Callable[[float], None]) -> Iterator[None]:
    """Replaces ``time.sleep`` and the clocks of ``time`` in this thread."""
    from unittest import mock

    mine = threading.get_ident()

    def here(virtual: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *args: (virtual if threading.get_ident() == mine else real)(*args)

    def clock(name: str) -> dict[str, Callable[..., Any]]:
        real, real_ns = getattr(time, name), getattr(time, f"{name}_ns")
        began = real_ns() - now_ns()
        return {
            name: here(lambda: (began + now_ns()) / 1e9, real),
            f"{name}_ns": here(lambda: began + now_ns(), real_ns),
        }

    patched: dict[str, Any] = {"sleep": here(sleep, time.sleep)}
    for name in ("monotonic", "perf_counter", "time"):
        patched.update(clock(name))
    with mock.patch.multiple(time, **patched):
        yield
