"""Scenarios, and presets of motors."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from motorlink import _core
from motorlink._sampling import Samples
from motorlink.sim._recording import structured
from motorlink.sim._source import Source, text_or_path


class Expectation(NamedTuple):
    """The result of one expectation of a scenario."""

    #: The expectation as text.
    why: str
    signal: str
    holds: bool
    #: The measured value, its time, and the expected value, as text.
    found: str


class Refusal(NamedTuple):
    """A reply that differs from the one that the scenario expects."""

    #: The time, s.
    at: float
    motor: str
    event: str
    #: The drive's error; ``None`` if it accepted a request that the scenario expects it to refuse.
    reply: str | None
    #: The error that the scenario expects; ``None`` if it expects none.
    announced: str | None
    #: The refusal as text.
    text: str


class Mark(NamedTuple):
    """An event of a scenario."""

    #: The time, s.
    at: float
    label: str


@dataclass(frozen=True)
class Run:
    """The result of a scenario."""

    title: str
    about: str | None
    #: A NumPy structured array: ``t`` in s, and every signal.
    samples: Samples
    #: The unit of each signal. States have no unit.
    units: dict[str, str]
    expectations: list[Expectation]
    #: Replies that differ from the expected ones.
    refusals: list[Refusal]
    #: The events and their times.
    marks: list[Mark]
    #: Whether all expectations hold.
    as_expected: bool
    #: A hash of the state of all drives at the end. Runs with the same hash had the same history.
    state_hash: str

    @property
    def failures(self) -> list[str]:
        """The expectations and replies that failed, one line each."""
        missed = [f"{one.why}: {one.signal} {one.found}" for one in self.expectations if not one.holds]
        return missed + [refusal.text for refusal in self.refusals]


def run(scenario: Source) -> Run:
    """Runs a scenario (docs/SCENARIOS.md): TOML text, or the path of a file.

    A ``str`` with a ``[``, a ``=`` or a line break is text. Paths in text are relative to the working
    directory. Raises :class:`~motorlink.InvalidValueError` for a wrong scenario, with the place.

    >>> told = run('''
    ...     title = "A turn"
    ...     duration = 1.0
    ...     [[rmd.motor]]
    ...     [[event]]
    ...     at = 0.1
    ...     rmd = 1
    ...     send = "position"
    ...     angle_degrees = 90
    ...     [[expect]]
    ...     why = "it arrives"
    ...     signal = "rmd1.angle_degrees"
    ...     at = 1.0
    ...     value = 90
    ...     within = 0.5
    ... ''')
    >>> told.as_expected, told.failures
    (True, [])
    >>> told.samples["rmd1.angle_degrees"].shape
    (1001,)
    """
    text, path = text_or_path(scenario)
    told = _core.sim_run(text, path)
    units = dict(told["signals"])
    values = [np.frombuffer(column, "f8") for column in told["columns"]]
    times = told["sample"] * np.arange(len(values[0])) / 1e6
    return Run(
        title=told["title"],
        about=told["about"],
        samples=structured(list(units), times, values),
        units=units,
        expectations=[Expectation(*one) for one in told["expectations"]],
        refusals=[Refusal(*one) for one in told["refusals"]],
        marks=[Mark(*one) for one in told["marks"]],
        as_expected=told["as_expected"],
        state_hash=f"{told['state_hash']:016x}",
    )


def presets() -> dict[str, dict[str, Any]]:
    """The presets of motors, with all values of their plants.

    >>> presets()["shinano"]["machine"]["pole_pairs"]
    2
    """
    known: dict[str, dict[str, Any]] = json.loads(_core.sim_presets())
    return known
