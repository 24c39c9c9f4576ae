"""Who uses which data segment of a drive, as far as one client knows."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from motorlink import _core
from motorlink.errors import InvalidValueError


class Segments:
    """The data segments of a drive: those that a program chose registers for, and those of samplings."""

    def __init__(self) -> None:
        # A signal handler may come in between.
        self._lock = threading.RLock()
        self._chosen: dict[int, list[str | int]] = {}
        self._sampled: set[int] = set()

    def claim(self, segment: int) -> None:
        """Keeps samplings away from a segment that a program is about to configure."""
        with self._lock:
            if segment in self._sampled:
                raise InvalidValueError(
                    f"data segment {segment} is in use by `sample`; nothing was sent: take another one,"
                    " or configure it before, and `sample` takes another one"
                )
            self._chosen.setdefault(segment, [])

    def chosen(self, segment: int, registers: Sequence[str | int]) -> None:
        """Remembers what a segment was configured with."""
        self._chosen[segment] = list(registers)

    def registers(self, segment: int) -> list[str | int]:
        """What a segment was configured with; nothing where that is not known."""
        return self._chosen.get(segment, [])

    def for_sampling(self, count: int) -> tuple[list[int], Callable[[], None]]:
        """Claims up to ``count`` free segments, the last one first; gives them and what releases them."""
        with self._lock:
            taken = self._sampled.union(self._chosen)
            free = [n for n in reversed(range(_core.ST_SEGMENTS)) if n not in taken][:count]
            self._sampled.update(free)

        def release() -> None:
            with self._lock:
                self._sampled.difference_update(free)

        return free, release
