"""Simulated drives in the process: motors that behave like motors, without hardware.

>>> from motorlink import sim
>>> bench = sim.Bench()
>>> motor = bench.st.motor(2)                # a 24 V servo; motor 1 is a bigger one
>>> motor.ramp(1000, 0.2)                    # rpm, s
>>> motor.start()
>>> bench.run(3.0)                           # s of virtual time, over at once
>>> round(motor.read("SPEED_MEAS"), -1)      # rpm
1000
>>> bench.brake("st2", 0.05)                 # Nm
>>> bench.run(1.0)
>>> round(bench.truth("st2")["torque_newton_metres"], 2)     # with friction
0.06

Time is *virtual*: it passes while an exchange is on the line, while a timeout is waited for, and in
:meth:`Bench.run`. Nothing sleeps, and the same calls give the same answers each time, noise and faults
of the line included, as long as they come from one thread.

Motors are called as their signals are: ``st2`` is motor 2 of the ST drive, ``rmd3`` the RMD motor with
ID 3. docs/SIMULATOR.md says what a configuration may contain, docs/SCENARIOS.md what signals there are.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Callable, NamedTuple, Union

import numpy as np

from motorlink import _core, rmd, st
from motorlink._sampling import Samples, columns
from motorlink.errors import BadValue

__all__ = [
    "Bench",
    "Expectation",
    "Mark",
    "Port",
    "Recording",
    "Refusal",
    "Run",
    "Serving",
    "presets",
    "run",
]

Source = Union[str, "os.PathLike[str]"]


class Bench:
    """An ST drive on a serial line and RMD motors on a CAN bus, on virtual time.

    ``config``: what there is. TOML text, the path of a TOML file (a ``str`` with a ``[``, a ``=`` or a
    line break is text), or the same as a ``dict``. Without it there are two ST motors and RMD motors 1 to 4.

    ``seed``: of the noise in the sensors; without it, as the configuration says. ``fault``: what the
    lines of this bench do, in the words of ``motorlink --fault``, such as ``"drop=1e-3,seed=7"``.

    A bench is a port: ``motorlink.st.open(bench)``, ``motorlink.rmd.open(bench, timeout=0.1)``.
    Raises :class:`~motorlink.BadValue` where a configuration is impossible, with the place.

    >>> bench = Bench("[[st.motor]]\\npreset = 'drone'")
    >>> bench.motors
    ('st1', 'rmd1', 'rmd2', 'rmd3', 'rmd4')
    >>> Bench({"st": {"motor": [{"preset": "big"}]}})
    Traceback (most recent call last):
        ...
    motorlink.errors.BadValue: st.motor 1: the presets are mains, servo, shinano, drone, not "big"
    """

    def __init__(
        self,
        config: Source | Mapping[str, Any] | None = None,
        *,
        seed: int | None = None,
        fault: str | None = None,
    ):
        if isinstance(config, Mapping):
            self._core = _core.SimBench(json=json.dumps(config), seed=seed)
        else:
            text, path = _text_or_path("" if config is None else config)
            self._core = _core.SimBench(toml=text, path=path, seed=seed)
        self._port = self._core.port(fault)
        self._st: st.Bus | None = None
        self._rmd: rmd.Bus | None = None

    @property
    def st(self) -> st.Bus:
        """The bus of the ST drive, open, with the drive's profile. For other options, ``st.open(bench, ...)``."""
        if self._st is None or self._st._is_closed:
            self._st = st.open(self, profile=self._core.profile)
        return self._st

    @property
    def rmd(self) -> rmd.Bus:
        """The bus of the RMD motors, open. For other options, ``rmd.open(bench, ...)``."""
        if self._rmd is None or self._rmd._is_closed:
            self._rmd = rmd.open(self)
        return self._rmd

    def port(self, *, fault: str | None) -> Port:
        """The bench as a port with other faults than its own.

        >>> import motorlink
        >>> bench = Bench()
        >>> bus = motorlink.st.open(bench.port(fault="drop=1,only=received"), timeout=30)
        >>> bus.motor(1).status()                    # 30 s pass at once
        Traceback (most recent call last):
            ...
        motorlink.errors.Timeout: ...
        >>> bench.now
        30.0
        """
        return Port(self._core.port(fault))

    # Time

    @property
    def now(self) -> float:
        """Time since the drives were powered on, s."""
        return self._core.now

    def run(self, seconds: float) -> None:
        """Lets time pass, s. Ctrl-C ends it.

        While the bench is served it takes that long.
        """
        self._core.run(seconds)

    @contextlib.contextmanager
    def patch_time(self) -> Iterator[None]:
        """Code of this thread that calls ``time.sleep`` lets time of the bench pass meanwhile.

        ``time.monotonic``, ``time.perf_counter``, ``time.time`` and their like in ns go by the bench, too. A
        name that was imported before (``from time import sleep``) stays as it is.

        >>> import time
        >>> bench = Bench()
        >>> with bench.patch_time():
        ...     began = time.monotonic()
        ...     time.sleep(60)
        ...     round(time.monotonic() - began)
        60
        """
        from unittest import mock

        mine = threading.get_ident()

        def here(virtual: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
            return lambda *args: (virtual if threading.get_ident() == mine else real)(*args)

        def clock(name: str) -> dict[str, Callable[..., Any]]:
            real, real_ns = getattr(time, name), getattr(time, f"{name}_ns")
            began = real_ns() - self._ns()
            return {
                name: here(lambda: (began + self._ns()) / 1e9, real),
                f"{name}_ns": here(lambda: began + self._ns(), real_ns),
            }

        patched: dict[str, Any] = {"sleep": here(self.run, time.sleep)}
        for name in ("monotonic", "perf_counter", "time"):
            patched.update(clock(name))
        with mock.patch.multiple(time, **patched):
            yield

    def _ns(self) -> int:
        return round(self.now * 1e6) * 1000

    # The world around the motors

    @property
    def motors(self) -> tuple[str, ...]:
        """What the motors are called."""
        return tuple(dict.fromkeys(name.partition(".")[0] for name, _ in self._core.signals))

    def brake(self, motor: str, newton_metres: float) -> None:
        """Sets the braking torque of the load, Nm, 0 to 1000. It only ever slows down."""
        self._do("load", motor, newton_metres=newton_metres)

    def push(self, motor: str, newton_metres: float) -> None:
        """Sets the torque with which something turns the output, Nm; negative backwards."""
        self._do("push", motor, newton_metres=newton_metres)

    def supply(self, motor: str, volts: float) -> None:
        """Sets the voltage of the source, V, 0 to 1000. The bus follows as its capacitor lets it."""
        self._do("supply", motor, volts=volts)

    def temperature(self, motor: str, celsius: float | None) -> None:
        """Makes the drive's sensor show a temperature, °C; ``None``: the motor's own again."""
        self._do("temperature", motor, celsius=celsius)

    def lock_rotor(self, motor: str, locked: bool = True) -> None:
        """Holds the rotor, or lets it go."""
        self._do("lock-rotor", motor, locked=locked)

    def inject(self, motor: str, fault: str, *, hold: bool | None = None) -> None:
        """Lets a fault happen: ``"BREAK_IN"`` (ST), ``"LOW_VOLTAGE"`` (RMD).

        It happens once; with ``hold=True`` its cause stays until ``hold=False``.

        >>> bench = Bench()
        >>> bench.inject("st1", "OVER_VOLT", hold=True)
        >>> bench.run(0.01)
        >>> bench.st.motor(1).status()
        State('FAULT_NOW')
        """
        self._do("fault", motor, fault=fault, hold=hold)

    def power_cycle(self, which: str) -> None:
        """Takes the power away and gives it back: RAM, turns and faults are gone, ROM stays.

        ``which``: ``"st"``, ``"rmd"``, or one RMD motor. An ST drive has one supply for its motors.
        """
        if which in ("st", "rmd"):
            self.execute({"command": "power-cycle", "port": which})
        else:
            self._do("power-cycle", which)

    def execute(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """Executes a command of a bench (docs/SIMULATOR.md); its ports are ``st`` and ``rmd``.

        Raises :class:`~motorlink.BadValue` where nothing was done.

        >>> Bench().execute({"command": "supply", "port": "rmd", "motor": 2, "volts": 6.5})
        {'ok': True}
        """
        try:
            text = json.dumps(dict(command), allow_nan=False)
        except (TypeError, ValueError) as error:
            raise BadValue(f"not a command: {error} in {dict(command)}") from error
        answer: dict[str, Any] = json.loads(self._core.execute(text))
        return answer

    def _do(self, command: str, motor: str, **members: Any) -> None:
        place = re.fullmatch(r"(st|rmd)(\d+)", motor)
        if place is None or motor not in self.motors:
            raise BadValue(f"there is no motor {motor!r}; there are {', '.join(self.motors)}")
        port, number = place[1], int(place[2])
        told = {name: value for name, value in members.items() if value is not None}
        self.execute({"command": command, "port": port, "motor": number, **told})

    # The truth

    @property
    def signals(self) -> dict[str, str]:
        """What can be looked at: the unit of each signal by its name; states and the like have none.

        >>> Bench().signals["rmd3.angle_degrees"]
        '°'
        """
        return dict(self._core.signals)

    def truth(self, motor: str) -> dict[str, Any]:
        """What really happens in a motor now: its signals by their names, which end with the unit.

        States, modes and faults are words.

        >>> truth = Bench().truth("rmd1")
        >>> truth["speed_dps"], truth["mode"], truth["errors"]
        (0.0, 'off', 'none')
        """
        truth = self._core.truth(motor)
        if not truth:
            raise BadValue(f"there is no motor {motor!r}; there are {', '.join(self.motors)}")
        return truth

    def record(
        self, signals: Sequence[str], *, seconds: float, every: float = 1e-3
    ) -> Samples:
        """Lets time pass, s, and gives what happened, a row ``every`` s.

        A structured array: ``t`` in s since the first row, the other fields are the signals as
        ``float64``. States, modes and faults are their numbers. ``motorlink.to_pandas`` takes it.

        >>> bench = Bench()
        >>> bench.rmd.motor(1).speed(360)
        MotionStatus(...)
        >>> data = bench.record(["rmd1.speed_dps"], seconds=0.5)
        >>> len(data), data.dtype.names
        (501, ('t', 'rmd1.speed_dps'))
        >>> round(float(data["rmd1.speed_dps"][-200:].mean()), -1)
        360.0
        """
        with self.recording(signals, every=every) as recording:
            self.run(seconds)
        return recording.data

    def recording(self, signals: Sequence[str], *, every: float = 1e-3) -> Recording:
        """Writes signals down, a row ``every`` s, whatever lets time pass meanwhile.

        >>> bench = Bench()
        >>> with bench.recording(["rmd1.speed_dps"], every=0.01) as recording:
        ...     for speed in (90, 180):
        ...         status = bench.rmd.motor(1).speed(speed)
        ...         bench.run(0.5)
        >>> len(recording.data)
        101
        """
        return Recording(self._core, signals, every)

    @property
    def state_hash(self) -> str:
        """A fingerprint of the state of all drives: benches with the same did the same."""
        return f"{self._core.state_hash:016x}"

    # Ports

    def serve(self, *, st: str | None = None, rmd: str | None = None) -> Serving:
        """Serves the drives on ports of this machine, on real time: for programs that open ports.

        ``st``: ``pty:PATH`` or ``tcp-listen:ADDRESS:PORT``; ``rmd``: ``slcan-pty:PATH``,
        ``tcp-listen:ADDRESS:PORT`` or ``socketcan:INTERFACE``. Without either, both are ptys in a
        temporary folder. A thread does it; the end of the ``with`` closes the ports, and time is
        virtual again.

        >>> import motorlink
        >>> with Bench().serve() as ports, motorlink.st.open(ports.st) as bus:
        ...     bus.motor(1).status()
        State('IDLE')
        """
        return Serving(self._core, st, rmd)

    def close(self) -> None:
        """Closes :attr:`st` and :attr:`rmd`, which stops what they started."""
        self._end(None, None, None)

    def _end(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            if self._st is not None:
                self._st.__exit__(kind, error, traceback)
        finally:
            if self._rmd is not None:
                self._rmd.__exit__(kind, error, traceback)

    def __enter__(self) -> Bench:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end(kind, error, traceback)

    def __repr__(self) -> str:
        return f"<motorlink.sim.Bench {', '.join(self.motors)} at {self.now:g} s>"


class Port:
    """A bench as a port, from :meth:`Bench.port`."""

    def __init__(self, core: _core.SimPort):
        self._port = core


class Recording:
    """What is written down of a bench until the end of its ``with``, from :meth:`Bench.recording`."""

    def __init__(self, core: _core.SimBench, signals: Sequence[str], every: float):
        self._names = columns([signals] if isinstance(signals, str) else signals)
        self._core = core.record(self._names, every)
        self._raw = bytearray()

    @property
    def data(self) -> Samples:
        """What was written down so far, as :meth:`Bench.record` gives it."""
        self._raw += self._core.take()
        rows = np.frombuffer(self._raw, "f8").reshape(-1, len(self._names))
        times = self._core.every * np.arange(len(rows)) / 1e6
        return _structured(self._names, times, rows.T)

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._raw += self._core.take()
        self._core.end()


class Serving:
    """Ports on which a bench is served until the end of its ``with``, from :meth:`Bench.serve`."""

    #: The ST drive for ``motorlink.st.open``; on a pty also for other programs. Empty: not served.
    st: str
    #: The RMD motors for ``motorlink.rmd.open``. Empty: not served.
    rmd: str
    #: What other programs open: device, address or CAN interface.
    st_path: str
    rmd_path: str

    def __init__(self, core: _core.SimBench, st: str | None, rmd: str | None):
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if st is None and rmd is None:
            self._folder = tempfile.TemporaryDirectory(prefix="motorlink-")
            st = f"pty:{self._folder.name}/st0"
            rmd = f"slcan-pty:{self._folder.name}/can0"
        try:
            self._core = core.serve(st=st, rmd=rmd)
        except BaseException:
            self._remove_folder()
            raise
        self.st, self.st_path = _opened(self._core.st, "")
        self.rmd, self.rmd_path = _opened(self._core.rmd, "slcan:")

    def close(self) -> None:
        """Closes the ports. Again is no error."""
        try:
            self._core.end()
        finally:
            self._remove_folder()

    def _remove_folder(self) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> Serving:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


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
    directory. Raises :class:`~motorlink.BadValue` where it says what cannot be.

    >>> told = run('''
    ...     title = "A turn"
    ...     duration = 1.0
    ...     [[rmd.motor]]
    ...     [[event]]
    ...     at = 0.1
    ...     rmd = 1
    ...     send = "move"
    ...     degrees = 90
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
    text, path = _text_or_path(scenario)
    told = _core.sim_run(text, path)
    units = dict(told["signals"])
    values = [np.frombuffer(column, "f8") for column in told["columns"]]
    times = told["sample"] * np.arange(len(values[0])) / 1e6
    return Run(
        title=told["title"],
        about=told["about"],
        samples=_structured(list(units), times, values),
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


def _structured(names: list[str], times: Any, values: Any) -> Samples:
    """A structured array of a time and a column a name."""
    names = ["t", *names]
    samples: Samples = np.empty(len(times), [(name, "f8") for name in names])
    for name, column in zip(names, [times, *values]):
        samples[name] = column
    return samples


def is_path(source: Any) -> bool:
    """Whether a configuration or scenario is the path of a file, not the text itself."""
    is_text = isinstance(source, str) and (not source or re.search(r"[=\[\n]", source))
    return isinstance(source, (str, os.PathLike)) and not is_text


def _text_or_path(source: Source) -> tuple[str, str | None]:
    """TOML text, or the path of a file."""
    return ("", os.fspath(source)) if is_path(source) else (str(source), None)


def _opened(served: tuple[str, str] | None, line: str) -> tuple[str, str]:
    """The port that reaches what is served, and its path; ``line``: how it speaks on a serial line."""
    if served is None:
        return "", ""
    port, path = served
    kind, _, name = port.partition(":")
    if kind == "tcp-listen":
        return f"{line}tcp:{path}", path
    return (port if kind == "socketcan" else line + name), path
