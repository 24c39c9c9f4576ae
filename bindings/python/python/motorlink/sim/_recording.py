"""Recordings of signals of a bench."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motorlink import _core
from motorlink._client import Closing
from motorlink._sampling import Samples, columns


class Recording(Closing):
    """A recording of signals until the end of its ``with``, from :meth:`Bench.recording`."""

    def __init__(self, core: _core.SimBench, signals: Sequence[str], every: float):
        self._names = columns([signals] if isinstance(signals, str) else signals)
        self._core = core.record(self._names, every)
        self._raw = bytearray()

    @property
    def data(self) -> Samples:
        """The rows so far, as :meth:`Bench.record` returns them."""
        self._raw += self._core.take()
        rows = np.frombuffer(self._raw, "f8").reshape(-1, len(self._names))
        times = self._core.every * np.arange(len(rows)) / 1e6
        return structured(self._names, times, rows.T)

    def _end(self, *, in_flight: bool) -> None:
        self._raw += self._core.take()
        self._core.end()


def structured(names: list[str], times: Any, values: Any) -> Samples:
    """A structured array of the time and one column for each name."""
    names = ["t", *names]
    samples: Samples = np.empty(len(times), [(name, "f8") for name in names])
    for name, column in zip(names, [times, *values]):
        samples[name] = column
    return samples
