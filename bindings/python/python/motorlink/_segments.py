"""The data segments of a drive that a client uses."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from motorlink import _core
from motorlink.errors import InvalidValueError


class Segments:
    """The data segments of a drive: those that the program configured, and those of samplings."""

    def __init__(self) -> None:
        # A signal handler may use the client meanwhile.
        self._lock = threading.RLock()
        self._chosen: dict[int, list[str | int]] = {}
        self._sampled: set[int] = set()

    def claim(self, segment: int) -> None:
        """Reserves a segment for the program, which is about to configure it."""
        with self._lock:
            if segment in self._sampled:
                raise InvalidValueError(
                    f"data segment {segment} is in use by a sampling or a recording; nothing was sent: use another"
                    " segment, or configure this one before"
                )
            self._chosen.setdefault(segment, [])

    def chosen(self, segment: int, registers: Sequence[str | int]) -> None:
        """Remembers the registers of a configured segment."""
        self._chosen[segment] = list(registers)

    def registers(self, segment: int) -> list[str | int]:
        """The registers of a configured segment; empty if this client did not configure it."""
        return self._chosen.get(segment, [])

    def for_sampling(self, count: int) -> tuple[list[int], Callable[[], None]]:
        """Reserves up to ``count`` free segments, the last one first. Returns them, and a function that frees them."""
        with self._lock:
            taken = self._sampled.union(self._chosen)
            free = [n for n in reversed(range(_core.ST_SEGMENTS)) if n not in taken][:count]
            self._sampled.update(free)

        def release() -> None:
            with self._lock:
                self._sampled.difference_update(free)

        return free, release
