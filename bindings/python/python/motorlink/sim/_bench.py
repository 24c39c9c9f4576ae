"""Benches: simulated drives, their time, their loads and their signals."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from motorlink import _core, rmd, st
from motorlink._client import Closing
from motorlink._sampling import Samples
from motorlink.errors import InvalidValueError
from motorlink.sim._recording import Recording
from motorlink.sim._serving import Serving
from motorlink.sim._source import Source, as_json, text_or_path
from motorlink.sim._time import patched_time


class Bench(Closing):
    """An ST drive on a serial line and RMD motors on a CAN bus, on virtual time.

    ``config``: TOML text, the path of a TOML file, or the same as a ``dict``. A ``str`` with a ``[``, a ``=``
    or a line break is text. The default has two ST motors and RMD motors 1 to 4.

    ``seed``: the seed of the sensor noise; the default is that of the configuration. ``fault``: faults of the
    lines of this bench, as in ``motorlink --fault``: ``"drop=1e-3,seed=7"``.

    A bench is a port: ``motorlink.st.open(bench)``, ``motorlink.rmd.open(bench, timeout=0.1)``.

    Raises :class:`~motorlink.InvalidValueError` for a wrong configuration, with the place.

    >>> bench = Bench("[[st.motor]]\\npreset = 'drone'")
    >>> bench.motors
    ('st1', 'rmd1', 'rmd2', 'rmd3', 'rmd4')
    >>> Bench({"st": {"motor": [{"preset": "big"}]}})
    Traceback (most recent call last):
        ...
    motorlink.errors.InvalidValueError: st.motor 1: the presets are mains, servo, shinano, drone, not "big"
    """

    def __init__(
        self,
        config: Source | Mapping[str, Any] | None = None,
        *,
        seed: int | None = None,
        fault: str | None = None,
    ):
        if isinstance(config, Mapping):
            json_text = as_json(config, "not a configuration")
            self._core = _core.SimBench(json=json_text, seed=seed)
        else:
            text, path = text_or_path("" if config is None else config)
            self._core = _core.SimBench(toml=text, path=path, seed=seed)
        self._port = self._core.port(fault)
        self._st: st.Client | None = None
        self._rmd: rmd.Client | None = None

    @property
    def st(self) -> st.Client:
        """An open client of the ST drive, with its profile. For other options call ``st.open(bench, ...)``."""
        if self._st is None or self._st._is_closed:
            self._st = st.open(self, profile=self._core.profile)
        return self._st

    @property
    def rmd(self) -> rmd.Client:
        """An open client of the RMD motors. For other options call ``rmd.open(bench, ...)``."""
        if self._rmd is None or self._rmd._is_closed:
            self._rmd = rmd.open(self)
        return self._rmd

    def port(self, *, fault: str | None) -> BenchPort:
        """The bench as a port with other faults.

        >>> import motorlink
        >>> bench = Bench()
        >>> client = motorlink.st.open(bench.port(fault="drop=1,only=received"), timeout=30)
        >>> client.motor(1).status()                    # 30 s of virtual time
        Traceback (most recent call last):
            ...
        motorlink.errors.ReplyTimeoutError: ...
        >>> bench.now
        30.0

        Raises :class:`~motorlink.InvalidValueError` for an unknown fault.
        """
        return BenchPort(self._core.port(fault))

    # Time

    @property
    def now(self) -> float:
        """Time since power-on of the drives, s."""
        return self._core.now

    def run(self, seconds: float) -> None:
        """Advances the time by ``seconds``. Ctrl-C ends it.

        While the bench is served it takes ``seconds`` of real time.
        """
        self._core.run(seconds)

    def patch_time(self) -> AbstractContextManager[None]:
        """During the ``with``, ``time.sleep`` in this thread advances the time of the bench.

        ``time.monotonic``, ``time.perf_counter``, ``time.time`` and their variants in ns return the time of the
        bench. A name that was imported before (``from time import sleep``) is not replaced.

        >>> import time
        >>> bench = Bench()
        >>> with bench.patch_time():
        ...     began = time.monotonic()
        ...     time.sleep(60)
        ...     round(time.monotonic() - began)
        60
        """
        return patched_time(lambda: round(self.now * 1e6) * 1000, self.run)

    # Loads, supply and faults

    @property
    def motors(self) -> tuple[str, ...]:
        """The names of the motors."""
        return tuple(dict.fromkeys(name.partition(".")[0] for name, _ in self._core.signals))

    def brake(self, motor: str, newton_metres: float) -> None:
        """Sets the braking torque of the load, Nm, 0 to 1000. It only slows the motor down."""
        self._do("load", motor, newton_metres=newton_metres)

    def push(self, motor: str, newton_metres: float) -> None:
        """Sets an external torque at the output, Nm. Negative turns backwards."""
        self._do("push", motor, newton_metres=newton_metres)

    def supply(self, motor: str, volts: float) -> None:
        """Sets the voltage of the supply, V, 0 to 1000. The bus capacitor follows."""
        self._do("supply", motor, volts=volts)

    def temperature(self, motor: str, celsius: float | None) -> None:
        """Overrides the drive's temperature sensor, °C. ``None`` removes the override."""
        self._do("temperature", motor, celsius=celsius)

    def lock_rotor(self, motor: str, locked: bool = True) -> None:
        """Locks the rotor, or releases it."""
        self._do("lock-rotor", motor, locked=locked)

    def inject(self, motor: str, fault: str, *, hold: bool | None = None) -> None:
        """Injects a fault: ``"BREAK_IN"`` (ST), ``"LOW_VOLTAGE"`` (RMD).

        The fault happens once. With ``hold=True`` its cause stays until ``hold=False``.

        >>> bench = Bench()
        >>> bench.inject("st1", "OVER_VOLT", hold=True)
        >>> bench.run(0.01)
        >>> bench.st.motor(1).status()
        Status('FAULT_NOW')
        """
        self._do("fault", motor, fault=fault, hold=hold)

    def power_cycle(self, which: str) -> None:
        """Switches the supply off and on. RAM, turns and faults are lost, ROM is kept.

        ``which``: ``"st"``, ``"rmd"``, or one RMD motor. The motors of an ST drive share one supply.
        """
        if which in ("st", "rmd"):
            self.execute({"command": "power-cycle", "port": which})
        else:
            self._do("power-cycle", which)

    def execute(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """Executes a command of a bench (docs/SIMULATOR.md). Its ports are ``st`` and ``rmd``.

        Raises :class:`~motorlink.InvalidValueError` for a command that cannot be executed.

        >>> Bench().execute({"command": "supply", "port": "rmd", "motor": 2, "volts": 6.5})
        {'ok': True}
        """
        text = as_json(command, "not a command")
        answer: dict[str, Any] = json.loads(self._core.execute(text))
        return answer

    def _do(self, command: str, motor: str, **members: Any) -> None:
        place = re.fullmatch(r"(st|rmd)(\d+)", motor)
        if place is None or motor not in self.motors:
            raise InvalidValueError(f"unknown motor {motor!r}: the motors are {', '.join(self.motors)}")
        port, number = place[1], int(place[2])
        told = {name: value for name, value in members.items() if value is not None}
        self.execute({"command": command, "port": port, "motor": number, **told})

    # Signals

    @property
    def signals(self) -> dict[str, str]:
        """The unit of each signal by its name. States have no unit.

        >>> Bench().signals["rmd3.angle_degrees"]
        '°'
        """
        return dict(self._core.signals)

    def truth(self, motor: str) -> dict[str, Any]:
        """The current signals of a motor by name. The end of a name is the unit. They come from the simulation
        itself, not through the protocol.

        States, modes and faults are words.

        >>> truth = Bench().truth("rmd1")
        >>> truth["speed_dps"], truth["mode"], truth["errors"]
        (0.0, 'off', 'none')
        """
        truth = self._core.truth(motor)
        if not truth:
            raise InvalidValueError(f"unknown motor {motor!r}: the motors are {', '.join(self.motors)}")
        return truth

    def record(
        self, signals: Sequence[str], *, seconds: float, every: float = 1e-3
    ) -> Samples:
        """Advances the time by ``seconds`` and records signals, one row each ``every`` s.

        Returns a NumPy structured array: ``t`` in s since the first row, and the signals as ``float64``. States,
        modes and faults are numbers. ``motorlink.to_pandas`` takes it.

        >>> bench = Bench()
        >>> bench.rmd.motor(1).set_speed(360)
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
        """Records signals during the ``with``, one row each ``every`` s of the bench.

        >>> bench = Bench()
        >>> with bench.recording(["rmd1.speed_dps"], every=0.01) as recording:
        ...     for speed in (90, 180):
        ...         status = bench.rmd.motor(1).set_speed(speed)
        ...         bench.run(0.5)
        >>> len(recording.data)
        101
        """
        return Recording(self._core, signals, every)

    @property
    def state_hash(self) -> str:
        """A hash of the state of all drives. Benches with the same hash had the same history."""
        return f"{self._core.state_hash:016x}"

    # Ports

    def serve(self, *, st: str | None = None, rmd: str | None = None) -> Serving:
        """Serves the drives on ports of this machine, on real time, for programs that open ports by name.

        ``st``: ``pty:PATH`` or ``tcp-listen:ADDRESS:PORT``. ``rmd``: ``slcan-pty:PATH``,
        ``tcp-listen:ADDRESS:PORT`` or ``socketcan:INTERFACE``. Without both, the ports are ptys in a temporary
        folder. The end of the ``with`` closes the ports, and time is virtual again.

        Raises :class:`~motorlink.PortError` if a port cannot be created,
        :class:`~motorlink.InvalidValueError` for a name that is not a port.

        >>> import motorlink
        >>> with Bench().serve() as ports, motorlink.st.open(ports.st) as client:
        ...     client.motor(1).status()
        Status('IDLE')
        """
        return Serving(self._core, st, rmd)

    def close(self) -> None:
        """Closes :attr:`st` and :attr:`rmd`, which stops the motors that they started."""
        self._end(in_flight=False)

    def _end(self, *, in_flight: bool) -> None:
        try:
            if self._st is not None:
                self._st._end(in_flight=in_flight)
        finally:
            if self._rmd is not None:
                self._rmd._end(in_flight=in_flight)

    def __repr__(self) -> str:
        if not hasattr(self, "_core"):
            # A traceback of pytest shows a bench that could not be built.
            return "<motorlink.sim.Bench, not built>"
        return f"<motorlink.sim.Bench {', '.join(self.motors)} at {self.now:g} s>"


class BenchPort:
    """A bench as a port, from :meth:`Bench.port`."""

    def __init__(self, core: _core.SimPort):
        self._port = core
