"""Scenarios, and the motors that they start from."""

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
    """What came of an expectation of a scenario."""

    #: The expectation in words.
    why: str
    signal: str
    holds: bool
    #: What was measured, when, and what was expected.
    found: str


class Refusal(NamedTuple):
    """A reply that was not as a scenario announced it."""

    #: Moment, s.
    at: float
    motor: str
    event: str
    #: What the drive said; ``None`` where it took what it was to refuse.
    reply: str | None
    #: What was announced; ``None`` where nothing was.
    announced: str | None
    #: All of it as text.
    text: str


class Mark(NamedTuple):
    """An event of a scenario."""

    #: Moment, s.
    at: float
    label: str


@dataclass(frozen=True)
class Run:
    """What came of a scenario."""

    title: str
    about: str | None
    #: A row a sample: ``t`` in s, and every signal.
    samples: Samples
    #: The unit of each signal; states and the like have none.
    units: dict[str, str]
    expectations: list[Expectation]
    #: Replies that were not as announced.
    refusals: list[Refusal]
    #: What happened when.
    marks: list[Mark]
    #: Whether everything was as expected.
    as_expected: bool
    #: A fingerprint of the state of all drives at the end: runs with the same did the same.
    state_hash: str

    @property
    def failures(self) -> list[str]:
        """What was not as expected, a line each."""
        missed = [f"{one.why}: {one.signal} {one.found}" for one in self.expectations if not one.holds]
        return missed + [refusal.text for refusal in self.refusals]


def run(scenario: Source) -> Run:
    """Plays a scenario (docs/SCENARIOS.md): TOML text, or the path of a file.

    A ``str`` with a ``[``, a ``=`` or a line break is text; files that it names are looked for in the working
    directory. Raises :class:`~motorlink.InvalidValueError` where it says what cannot be.

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
    """The motors that there are to start from, with every value of their plants.

    >>> presets()["shinano"]["machine"]["pole_pairs"]
    2
    """
    known: dict[str, dict[str, Any]] = json.loads(_core.sim_presets())
    return known
