"""Recordings that are read."""

from __future__ import annotations

import os
import pathlib
import warnings
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Union

import numpy as np
import numpy.typing as npt

from motorlink import _core
from motorlink._sampling import Samples, data_frame
from motorlink.errors import InvalidValueError, RecordingWarning
from motorlink.recording._frames import Frames


class Event(NamedTuple):
    """Something that happened during a recording."""

    #: Time since the start of the recording, s. An event may be before it.
    t: float
    #: ns since 1970.
    time_ns: int
    #: ``INFO``, ``WARN`` or ``ERROR``.
    severity: str
    #: What it concerns: ``st0/motor1``, or ``st0``.
    name: str
    #: The kind: ``commanded``, ``stopped``, ``lost``, ``back`` (docs/RECORDING.md).
    kind: str
    #: The sentence.
    message: str
    #: The program that commanded it; empty without a command.
    by: str


class Drive(NamedTuple):
    """A motor that was recorded."""

    #: Label of the port and motor: ``st0/motor1``.
    name: str
    #: Label of the port: ``st0``.
    label: str
    #: Name of the port.
    port: str
    #: ``st`` or ``rmd``.
    protocol: str
    #: The profile of an ST drive, otherwise ``None``.
    profile: str | None
    #: Number or ID.
    motor: int | None
    #: Lines about the drive: board, firmware, versions.
    identity: tuple[str, ...]
    #: Its settings at the start, for ``motor.settings.restore`` and ``diff``. ``None``: not recorded.
    settings: str | None


class Table(Mapping[str, "npt.NDArray[np.float64]"]):
    """Signals of a motor that were read at the same instants.

    ``table["SPEED_MEAS"]`` is an array with a value for each row, NaN where the drive gave none.
    ``table["t"]`` is the time of the rows since the start of the recording, s.
    """

    #: The motor: ``st0/motor1``.
    motor: str
    #: The topic in the file: ``/st0/motor1/signals``.
    topic: str
    #: Units by signal; empty for a number without a unit.
    units: dict[str, str]
    #: The time of the rows, ns since 1970. ``table.time_ns.view("datetime64[ns]")`` are dates.
    time_ns: npt.NDArray[np.int64]
    #: The time between the first request and the last reply of each row, s.
    span_s: npt.NDArray[np.float64]

    def __init__(
        self,
        motor: str,
        topic: str,
        columns: list[tuple[str, str, bytearray]],
        times: bytearray,
        spans: bytearray,
    ):
        self.motor, self.topic = motor, topic
        self.units = {name: unit for name, unit, _ in columns}
        self.time_ns = np.frombuffer(times, np.int64)
        self.span_s = np.frombuffer(spans, np.float64)
        self._columns = {name: np.frombuffer(values, np.float64) for name, _, values in columns}
        #: The tables of other signals of the motor, by signal.
        self._elsewhere: dict[str, str] = {}

    @property
    def samples(self) -> Samples:
        """A structured array, as ``client.sample`` returns it: ``t`` in s, and a field for each signal."""
        samples: Samples = np.empty(len(self.time_ns), [(name, "f8") for name in self._columns])
        for name, column in self._columns.items():
            samples[name] = column
        return samples

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame``. Its index is the time in s. Raises ``ImportError`` without pandas."""
        return data_frame(self._columns)

    def __getitem__(self, name: str) -> npt.NDArray[np.float64]:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(self._missing(name)) from None

    def _missing(self, name: str) -> str:
        if name in self._elsewhere:
            other = self._elsewhere[name]
            return f"{name} of {self.motor} was read at other instants: run[{other!r}] has it"
        return f"{self.topic} has no signal {name}; it has {', '.join(self._columns)}"

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        names = ", ".join(name for name in self._columns if name != "t")
        return f"<{type(self).__module__}.Table {self.topic}, {len(self.time_ns)} rows: {names}>"


class Recording(Mapping[str, Table]):
    """A recording that was read, from :func:`motorlink.read`.

    ``run["st0/motor1"]`` is the :class:`Table` with the signals of a motor. Signals that were read more
    rarely have a table of their own, such as ``run["st0/motor1/signals_2_hz"]``. ``list(run)`` has the
    names of all tables. A name is its topic without the first ``/``.
    """

    #: The file.
    path: pathlib.Path
    #: The motors.
    drives: tuple[Drive, ...]
    #: What happened, in the order of time.
    events: tuple[Event, ...]
    #: What is known of the recording: version of the program, its command, the time of the start.
    about: dict[str, str]
    #: All metadata records of the file: name, facts.
    metadata: list[tuple[str, dict[str, str]]]
    #: ``t`` = 0: the time of the first row, ns since 1970.
    start_ns: int

    def __init__(self, path: pathlib.Path):
        self.path = path
        self._core = core = _core.RecordingFile.open(path)
        self.start_ns, tables, events, malformed = core.tables()
        self._tables: dict[str, Table] = {}
        for one in tables:
            table = Table(*one)
            self._tables[self._free_name(table.topic.strip("/"))] = table
        for table in self._tables.values():
            others = {name: it for name, it in self._tables.items() if it.motor == table.motor}
            table._elsewhere = {signal: name for name, it in others.items() for signal in it}
        self.events = tuple(Event(*event) for event in events)
        self.drives = tuple(Drive(*drive[:6], tuple(drive[6]), drive[7]) for drive in core.drives)
        self.about, self.metadata = core.about, core.metadata
        self._warn(malformed, callers=2)

    @property
    def lost(self) -> str | None:
        """What could not be read of a broken file; ``None`` if nothing is lost."""
        return self._core.lost

    @property
    def lost_bytes(self) -> int:
        """The number of bytes that could not be read."""
        return self._core.lost_bytes

    @property
    def lines(self) -> list[str]:
        """The labels of the lines whose frames were recorded."""
        return self._core.lines

    def frames(self, line: str | None = None) -> Frames:
        """Reads the frames of a line, such as ``st0``. It may be left out if there is one line only.

        Raises ``InvalidValueError`` for another name.
        """
        lines = self.lines
        if line is None and len(lines) == 1:
            (line,) = lines
        if line is None or line not in lines:
            known = ", ".join(map(repr, lines)) or "none"
            raise InvalidValueError(f"{self.path} has no frames of {line!r}: its lines are {known}")
        times, directions, ids, results, begins, data, malformed = self._core.frames(line)
        if malformed:
            self._warn(malformed, callers=1)
        return Frames(self.start_ns, times, directions, ids, results, begins, data)

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` of all tables. Its index is the time in s.

        A column is ``st0/motor1/SPEED_MEAS``. It is NaN at the instants of other tables. Raises
        ``ImportError`` without pandas.
        """
        times = np.concatenate([[], *(table["t"] for table in self.values())])
        order = np.argsort(times, kind="stable")
        columns, before = {"t": times[order]}, 0
        for table in self.values():
            end = before + len(table.time_ns)
            for name, values in table.items():
                if name != "t":
                    column = np.full(len(order), np.nan)
                    column[before:end] = values
                    columns[f"{table.motor}/{name}"] = column[order]
            before = end
        return data_frame(columns)

    def __getitem__(self, name: str) -> Table:
        name = name.strip("/")
        table = self._tables.get(name) or self._of_motor(name)
        if table is None:
            known = ", ".join(self._tables) or "no signals"
            raise KeyError(f"{self.path} has no signals of {name}; it has {known}")
        return table

    def _of_motor(self, name: str) -> Table | None:
        """The table of a motor with the signals that were read most often."""
        tables = [table for table in self._tables.values() if table.motor == name]
        return min(tables, key=lambda table: len(table.topic), default=None)

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables)

    def __len__(self) -> int:
        return len(self._tables)

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Recording {self.path}: {', '.join(self._tables) or 'no signals'}>"

    def _free_name(self, topic: str) -> str:
        """A topic may be there twice with different signals, in a file of two recordings."""
        names = (topic if number == 1 else f"{topic}_{number}" for number in range(1, len(self._tables) + 2))
        return next(name for name in names if name not in self._tables)

    def _warn(self, malformed: int, *, callers: int) -> None:
        """Warns of what is lost. The warning is that of the caller so many functions above."""
        messages = []
        if self.lost is not None:
            messages.append(f"{self.path} is not whole: {self.lost}")
        if malformed:
            messages.append(f"{self.path}: {malformed} messages are not of the type of their topic")
        for message in messages:
            warnings.warn(message, RecordingWarning, stacklevel=callers + 2)


def read(path: Union[str, "os.PathLike[str]"]) -> Recording:
    """Reads a recording (docs/RECORDING.md), whole or broken.

    Of a broken file all that can be read is given. A :class:`~motorlink.errors.RecordingWarning` says what
    is lost, and so does ``Recording.lost``.

    Raises ``RecordingError`` if the file cannot be read or is not an MCAP file.
    """
    return Recording(pathlib.Path(path))
