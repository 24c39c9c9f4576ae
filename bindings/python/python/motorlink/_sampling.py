"""Samples as NumPy arrays, and what can be made of them."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from motorlink.errors import InvalidValueError

Name = TypeVar("Name")

#: A structured array: ``t`` in s since the first instant, and a field a value.
Samples = npt.NDArray[np.void]


def by_motor(
    wanted: Mapping[int, Sequence[Name]] | Sequence[Name], motor: int, called: Callable[[Name], str]
) -> tuple[list[tuple[int, list[Name]]], list[str]]:
    """What is wanted of each motor, and what the values are called, each once.

    Where motors are named, so is the motor of a value.
    """
    if isinstance(wanted, str):
        raise InvalidValueError(f"{wanted!r} is one name: give a list of names")
    if isinstance(wanted, Mapping):
        motors = [(number, list(some)) for number, some in wanted.items()]
        names = [f"{called(one)}_{number}" for number, some in motors for one in some]
    else:
        motors = [(motor, list(wanted))]
        names = [called(one) for one in motors[0][1]]
    return motors, columns(names)


def columns(names: Sequence[str]) -> list[str]:
    """The names of the values, each once."""
    if not names:
        raise InvalidValueError("name what to sample")
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise InvalidValueError(f"{', '.join(sorted(twice))}: named twice in one sample")
    return list(names)


def skips(on_error: str) -> bool:
    """Whether a row that fails is left out."""
    if on_error not in ("raise", "skip"):
        raise InvalidValueError(f"on_error={on_error!r}: give 'raise' or 'skip'")
    return on_error == "skip"


def array(
    outcome: tuple[bytearray, BaseException | None], names: Sequence[str], *, raw: bool
) -> Samples:
    """The rows as an array; raises what ended them early, with the array in its ``samples``."""
    rows, error = outcome
    kind = "i8" if raw else "f8"
    samples = np.frombuffer(rows, dtype=[("t", "f8"), *((name, kind) for name in names)])
    if error is not None:
        error.samples = samples  # type: ignore[attr-defined]
        raise error
    return samples


def to_pandas(samples: Samples) -> Any:
    """A ``pandas.DataFrame`` of what ``client.sample`` gave, with the time in s as its index.

    Raises ``ImportError`` where pandas is not installed.
    """
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError("to_pandas needs pandas: `pip install pandas`", name="pandas") from error
    named = {name: samples[name] for name in samples.dtype.names or ()}
    return pandas.DataFrame(named).set_index("t")
