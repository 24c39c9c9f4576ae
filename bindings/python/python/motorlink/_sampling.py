"""Sampling: rows one after the other, and all of them as a NumPy array."""

from __future__ import annotations

import importlib
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, Union

import numpy as np
import numpy.typing as npt

from motorlink._apis import Blocking, Exchanges, both_apis
from motorlink.errors import InvalidValueError

Name = TypeVar("Name")

#: A structured array: ``t`` in s since the first instant, and one field for each value.
Samples = npt.NDArray[np.void]


def by_motor(
    wanted: Mapping[int, Sequence[Name]] | Sequence[Name], motor: int, called: Callable[[Name], str]
) -> tuple[list[tuple[int, list[Name]]], list[str]]:
    """The values to read of each motor, and their names in a row.

    The names have the motor's number if motors are named.
    """
    for some in wanted.values() if isinstance(wanted, Mapping) else [wanted]:
        if isinstance(some, str):
            raise InvalidValueError(f"{some!r} is one name: give a list of names")
    if isinstance(wanted, Mapping):
        motors = [(number, list(some)) for number, some in wanted.items()]
        names = [f"{called(one)}_{number}" for number, some in motors for one in some]
    else:
        motors = [(motor, list(wanted))]
        names = [called(one) for one in motors[0][1]]
    return motors, columns(names)


def columns(names: Sequence[str]) -> list[str]:
    """The names of the values. Raises for a name that is there twice."""
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


class Sample(dict[str, float]):
    """One row of ``client.samples``: the values by name, and ``t``.

    >>> import motorlink
    >>> with motorlink.st.open("sim:") as client:
    ...     row = next(client.samples(["BUS_VOLTAGE"], rate=100))
    >>> row
    {'t': 0.0, 'BUS_VOLTAGE': 325.0}
    >>> row.t, row.skipped
    (0.0, 0)
    """

    __slots__ = ("skipped",)

    #: Instants without a row between the row before and this one: the program or the line was too
    #: slow for them, or they failed with ``on_error="skip"``.
    skipped: int

    @property
    def t(self) -> float:
        """Time from the first instant to the first request of this row, s."""
        return self["t"]


#: An exchange that reads so many rows, or all. Returns their bytes, the skipped instants, the error.
Take = Callable[[Union[int, None]], Any]


class AnySampling:
    """The samplings of both APIs."""

    def __init__(
        self,
        client: object,
        take: Take,
        names: Sequence[str],
        *,
        raw: bool,
        release: Callable[[], object],
    ):
        # Without this, `for row in open(port).samples(...)` would close the client at once.
        self._client = client
        kind = "i8" if raw else "f8"
        self._columns = np.dtype([("t", "f8"), *((name, kind) for name in names)])
        self._take = take
        self._turn = threading.Lock()
        self._ended = False
        self._release = weakref.finalize(self, release)

    def close(self) -> None:
        """Ends the sampling. If another thread or task waits for a row, that row is the last one."""
        self._ended = True
        self._release_when_idle()

    @both_apis
    def _array(self) -> Exchanges[Samples]:
        """All rows."""
        samples, _ = yield from self._taken(None)
        self.close()
        return samples

    @both_apis
    def _row(self) -> Exchanges[Sample | None]:
        """The next row; ``None`` at the end."""
        if self._ended:
            return None
        samples, skipped = yield from self._taken(1)
        if not len(samples):
            self.close()
            return None
        row = Sample(zip(samples.dtype.names or (), samples[0].item()))
        row.skipped = skipped
        return row

    def _taken(self, most: int | None) -> Exchanges[tuple[Samples, int]]:
        """New rows, and the instants that were skipped. Any error ends the sampling."""
        if not self._turn.acquire(blocking=False):
            raise RuntimeError("this sampling is in use by another thread, task or signal handler")
        try:
            rows, skipped, error = yield self._take(most)
            samples = np.frombuffer(rows, dtype=self._columns)
            if error is not None:
                error.samples = samples
                raise error
        except BaseException:
            self._ended = True
            raise
        finally:
            self._turn.release()
            if self._ended:
                self._release_when_idle()
        return samples, skipped

    def _release_when_idle(self) -> None:
        """Releases the data segments of the drive; not while a row is read from them."""
        if self._turn.acquire(blocking=False):
            self._release()
            self._turn.release()


class Sampling(Blocking, AnySampling):
    """Rows of ``client.samples``, read one after the other: an iterator of :class:`Sample`."""

    def __iter__(self) -> Sampling:
        return self

    def __next__(self) -> Sample:
        row = self._row()
        if row is None:
            raise StopIteration
        return row


def to_pandas(samples: Samples) -> Any:
    """A ``pandas.DataFrame`` of the array from ``client.sample``. Its index is the time in s.

    Raises ``ImportError`` if pandas is not installed.
    """
    return data_frame({name: samples[name] for name in samples.dtype.names or ()})


def data_frame(columns: Mapping[str, npt.NDArray[Any]]) -> Any:
    """A ``pandas.DataFrame`` of columns. ``t`` is its index."""
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError("to_pandas needs pandas: `pip install pandas`", name="pandas") from error
    return pandas.DataFrame(dict(columns)).set_index("t")
