"""Recordings in progress."""

from __future__ import annotations

import atexit
import os
import sys
import warnings
import weakref
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, NamedTuple, Union

from motorlink import _core
from motorlink._client import Closing, close_left_open, is_any_moving
from motorlink.errors import InvalidValueError, MotorlinkError, RecordingError, RecordingWarning

if TYPE_CHECKING:
    from motorlink import rmd, st

#: A port by its name, or an open client.
Source = Union[str, "os.PathLike[str]", "st.Client", "rmd.Client"]

#: How long the end of ``with`` waits for the last confirmed values while a motor moves, s.
_WITH_MOTORS = 0.6
#: How long it waits for the disk otherwise, s.
_PATIENCE = 5.0
#: A look whether a file is complete, s.
_LOOK = 1e-6


class Status(NamedTuple):
    """How far a recording is, from :meth:`Recorder.status`."""

    #: How long it has recorded, s.
    seconds: float
    #: The files, in the order of time.
    files: tuple[FilePath, ...]
    #: Bytes of all files.
    bytes: int
    #: Rows of signals.
    rows: int
    #: Values in these rows.
    values: int
    #: Frames.
    frames: int
    #: Rows that were left out, because nothing confirmed them.
    unconfirmed: int
    #: Messages that were lost, because this machine or the disk was too slow.
    lost: int
    #: The rate that was asked for, Hz. ``None`` in the first second.
    asked_hz: float | None
    #: The least rate that is reached, Hz.
    achieved_hz: float | None
    #: Signals that the drives refuse: ``st0/motor1/SPEED_MEAS``.
    refused: tuple[str, ...]
    #: Motors of which no value came: ``st0/motor1``.
    silent: tuple[str, ...]
    #: How long motors had no values, s, if it was longer than 1 s (at low rates: three periods).
    gaps: dict[str, float]
    #: Nothing more is recorded: it was closed, has ``max_size``, or the file cannot be written.
    is_over: bool


class Recorder(Closing):
    """A recording in progress, from :func:`motorlink.record`. The end of its ``with`` ends it."""

    #: The motors: ``st0/motor1``.
    motors: tuple[str, ...]

    def __init__(self, core: _core.RecordingInProgress, release: Callable[[], None]):
        self._core = core
        self.motors = tuple(core.motors)
        # Ended by `_end_all` when the program ends, which stops motors before.
        self._leave = weakref.finalize(self, _left, core, release)
        self._leave.atexit = False  # type: ignore[misc]
        _open[id(core)] = core

    def status(self) -> Status:
        """How far it is. In a forked process it is unknown: raises ``RecordingError``."""
        self._check()
        found = self._core.status()
        names = ("files", "refused", "silent")
        return Status(**{**found, **{name: tuple(found[name]) for name in names}})

    def close(self) -> None:
        """Ends the recording and its file. Motors are not affected. A second call does nothing.

        Raises ``RecordingError`` if the file cannot be written any more, or if the disk has not taken it
        within 5 s. While a motor moves it waits for 0.6 s at most, and warns. The file is completed in the
        background then.
        """
        self._end(in_flight=False)

    def _end(self, *, in_flight: bool) -> None:
        if not self._leave.alive or not self._core.is_here:
            return
        is_complete = False
        if in_flight:
            # The next thing to be left may be a client, which stops motors: nothing waits for a disk.
            self._leave()
            return
        try:
            is_complete = self._core.finish(_WITH_MOTORS)
            is_waited = not is_complete and not is_any_moving()
            if is_waited:
                is_complete = self._core.finish(_PATIENCE)
        except MotorlinkError:
            is_complete = True
            raise
        finally:
            self._leave()
            if is_complete:
                _ending.pop(id(self._core), None)
        if is_complete:
            return
        late = f"the disk has not taken {_files(self._core)} yet; it is still being written"
        if is_waited:
            raise RecordingError(late)
        warnings.warn(late, RecordingWarning, stacklevel=3)

    def _check(self) -> None:
        if not self._core.is_here:
            raise RecordingError("another process records, which this one was forked from")

    def __repr__(self) -> str:
        over = ", ended" if not self._leave.alive else ""
        return f"<{type(self).__module__}.Recorder {', '.join(self.motors)}{over}>"


#: Recordings in progress.
_open: dict[int, _core.RecordingInProgress] = {}
#: Recordings that were left, whose files may not be complete.
_ending: dict[int, _core.RecordingInProgress] = {}


def _left(core: _core.RecordingInProgress, release: Callable[[], None]) -> None:
    """Begins the end of a recording that was left, and does not wait."""
    core.begin_end()
    _open.pop(id(core), None)
    _ending[id(core)] = core
    release()


def _complete(wait: float) -> None:
    """Waits so many s for each file of a recording that was left. Warns of those that cannot be written."""
    for key, core in list(_ending.items()):
        try:
            is_complete = not core.is_here or core.finish(wait)
        except MotorlinkError as error:
            is_complete = True
            warnings.warn(str(error), RecordingWarning, stacklevel=3)
        if is_complete:
            _ending.pop(key, None)


@atexit.register
def _end_all() -> None:
    """Completes the files at the end of the program. Motors stop before."""
    if not _open and not _ending:
        return
    close_left_open()
    _ending.update(_open)
    _complete(_PATIENCE)
    for core in _ending.values():
        warnings.warn(f"{_files(core)} has no end: the disk is too slow", RecordingWarning, stacklevel=1)


def _files(core: _core.RecordingInProgress) -> str:
    return ", ".join(map(str, core.status()["files"]))


def record(
    source: Source | Sequence[Source],
    path: str | os.PathLike[str],
    signals: Sequence[str] = (),
    *,
    rate: float = 100.0,
    profile: str = "spec",
    timeout: float | None = None,
    motors: Sequence[int] = (),
    ids: Sequence[int] = (),
    settings: bool = True,
    force: bool = False,
    max_size: int | None = None,
    rotate_size: int | None = None,
    rotate_seconds: float | None = None,
    fsync: float | None = None,
) -> Recorder:
    """Records motors into an MCAP file (docs/RECORDING.md) until the end of ``with``.

    ``source``
        The name of a port, an open client, or a list of them. With a client the program commands motors
        while they are recorded: frames of its own requests are in the file, too. What it sends waits for
        one exchange of the recording at most. When it closes the client, the recording of this client is
        over. A client of asyncio cannot be recorded, nor one of a bench: record a line of
        ``motorlink share``, or a port.
    ``path``
        The file, such as ``run.mcap``. With ``rotate_size`` or ``rotate_seconds`` its name before the
        number: ``run_000.mcap``.
    ``signals``
        Names of signals. Without names: state, speed, current and angle; twice a second voltage and
        temperature.
    ``rate``
        How often signals are read, Hz.
    ``profile``, ``timeout``
        Of the drives at ports: the profile of ST drives, and how long a reply may take, s. A client has
        its own.
    ``motors``, ``ids``
        Numbers of ST motors and IDs of RMD motors. Without them: those that answer.
    ``settings``
        ``False`` does not read the settings of the motors at the start.
    ``force``
        Overwrites files that exist.
    ``max_size``
        Ends the recording when its files have so many bytes.
    ``rotate_size``, ``rotate_seconds``
        Begins another file after so many bytes, or after this time, s.
    ``fsync``
        Waits for the disk this often, s: a power failure loses this time only.

    No motor starts or stops. A recording that is left open is ended when it is garbage-collected or when
    the program ends. After an exception the end of ``with`` does not wait for the file.

    Raises ``RecordingError`` if the file exists or cannot be written, ``PortError`` if a port cannot be
    opened, ``ReplyTimeoutError`` if no motor answers, ``InvalidValueError`` for a wrong argument.
    """
    if isinstance(signals, str):
        raise InvalidValueError(f"{signals!r} is one name: give a list of names")
    _complete(_LOOK)
    is_one = isinstance(source, (str, os.PathLike)) or not isinstance(source, Sequence)
    sources: Sequence[Source] = [source] if is_one else source  # type: ignore[list-item, assignment]
    ports = [os.fspath(one) for one in sources if isinstance(one, (str, os.PathLike))]
    with ExitStack() as released:
        clients = []
        for one in sources:
            if not isinstance(one, (str, os.PathLike)):
                client, release = _recorded(one)
                released.callback(release)
                clients.append(client)
        core = _core.RecordingInProgress.start(
            ports,
            clients,
            os.fspath(path),
            list(signals),
            rate,
            profile,
            timeout,
            list(motors),
            list(ids),
            settings,
            force,
            max_size,
            rotate_size,
            rotate_seconds,
            fsync,
            f"python {sys.argv[0]}" if sys.argv else "python",
        )
        return Recorder(core, released.pop_all().close)


def _recorded(client: st.Client | rmd.Client) -> tuple[_core.RecordedClient, Callable[[], None]]:
    """A client for the recording, and what to call at its end."""
    if not hasattr(client, "_recorded"):
        raise TypeError(f"{client!r} cannot be recorded: give the name of a port, or a blocking client")
    return client._recorded()
