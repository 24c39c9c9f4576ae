"""Settings of a motor as text, for both protocols and both APIs."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Union

from motorlink import _core
from motorlink._apis import Blocking, Exchanges, both_apis
from motorlink.errors import InvalidValueError, MotorlinkError, SettingsError


class SettingDifference(NamedTuple):
    """A setting that a motor and a file have with different values."""

    name: str
    #: The value of the motor. ``restore`` returns the value before it.
    motor: float
    #: The value of the file.
    file: float
    #: The unit of both; empty for a number without one.
    unit: str


class SettingsDump(Mapping[str, float]):
    """The settings of a motor: a mapping from names to values. ``str(dump)`` is the text of a file.

    >>> import motorlink
    >>> with motorlink.rmd.open("sim:") as client:
    ...     dump = client.motor(1).settings.dump()
    >>> dump["acceleration"], dump.units["acceleration"]
    (0, '°/s²')
    >>> str(dump).splitlines()[3]
    '[rmd]'
    """

    __slots__ = ("_absent", "_text", "_units", "_values")

    def __init__(self, text: str, values: list[tuple[str, float, str]], absent: list[str]):
        self._text = text
        self._values = {name: value for name, value, _ in values}
        self._units = {name: unit for name, _, unit in values}
        self._absent = tuple(absent)

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each setting; empty for a number without one."""
        return self._units

    @property
    def absent(self) -> tuple[str, ...]:
        """The names of settings that the drive refuses to read."""
        return self._absent

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"<SettingsDump {self._values!r}>"


#: The text of a file, a dump, or the path of a file.
SettingsSource = Union[str, SettingsDump, "os.PathLike[str]"]


def text_of(settings: SettingsSource) -> str:
    """The text of a file of settings."""
    if isinstance(settings, (str, SettingsDump)):
        text = str(settings)
        if "\n" not in text and "=" not in text:
            raise InvalidValueError(
                f"{text!r} is not the text of a file with settings; for a file give its path:"
                f" pathlib.Path({text!r})"
            )
        return text
    if not isinstance(settings, os.PathLike):
        raise TypeError(
            f"give the text of a file with settings, a dump or a pathlib.Path, not {settings!r}"
        )
    path = Path(settings)
    try:
        with path.open(encoding="utf-8") as file:
            # A device may have no end. A longer text is refused.
            return file.read(_core.SETTINGS_MAX_SIZE + 1)
    except UnicodeDecodeError as error:
        raise InvalidValueError(f"{path} is not a text in UTF-8: {error}") from error


class HasSettings(Protocol):
    """A motor of either protocol and API."""

    @property
    def client(self) -> Any: ...
    def _settings(self) -> _core.MotorSettings: ...
    def _check(self, motor: int, request: Any) -> None: ...
    def _confirm(self) -> Any: ...


class AnySettings:
    """What the settings of both APIs have in common."""

    __slots__ = ("_core", "_motor")

    def __init__(self, motor: HasSettings):
        self._motor = motor
        self._core = motor._settings()

    @both_apis
    def dump(self) -> Exchanges[SettingsDump]:
        """Reads all settings of the motor.

        ``str(dump)`` is the same text as the file of ``motorlink st dump`` or ``motorlink rmd dump``:
        ``Path("motor1.toml").write_text(str(dump))``.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     dump = client.motor(1).settings.dump()
        >>> dump["REVUP_0_DURATION"], dump.units["REVUP_0_DURATION"]
        (200, 'ms')
        """
        return SettingsDump(*(yield from self._carried_out(self._core.dumping())))

    @both_apis
    def diff(self, settings: SettingsSource) -> Exchanges[list[SettingDifference]]:
        """Compares the motor with the text of a file, with a dump, or with the file of a ``Path``.

        Returns the settings that differ, in the order of the file. Settings without a line are not read.

        Raises ``InvalidValueError`` with the line for a file that is not for this motor. Raises
        ``SettingsError`` if a setting cannot be read.
        """
        comparison = yield from self._compared(settings)
        return comparison.differences()

    @both_apis
    def restore(
        self,
        settings: SettingsSource,
        *,
        dry_run: bool = False,
        to_rom: bool = False,
        running: bool = False,
    ) -> Exchanges[list[SettingDifference]]:
        """Writes the settings that differ, and reads each back. Returns them with their old values.

        ``settings`` is the text of a file, a dump, or the ``Path`` of a file. Settings without a line stay as
        they are. ``dry_run=True`` writes nothing, and returns what would be written. ``to_rom=True`` allows
        writes to the ROM of an RMD motor, which wear it: the encoder offset if it differs, and the gains in
        any case, because their values in ROM cannot be read. A motor that is not at rest is refused:
        ``running=True`` allows it, and the motor may then move differently.

        If a write fails, after Ctrl-C, and if the task is cancelled, the old values are written again. A
        second Ctrl-C or cancellation ends that. SIGTERM ends the program without it.

        Raises ``InvalidValueError`` with the line for a file that is not for this motor. Raises
        ``SettingsError`` if the settings were not restored. Its message says which settings have which
        values. It is the cause of a ``KeyboardInterrupt`` and of a ``CancelledError``.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     settings = client.motor(1).settings
        ...     before = settings.dump()
        ...     client.motor(1).set("SPEED_KP", 1200)
        ...     settings.restore(before)
        [SettingDifference(name='SPEED_KP', motor=1200, file=249, unit='s16A/unit')]
        """
        with self._alone():
            comparison = yield from self._compared(settings)
            steps = comparison.restoring(dry_run=dry_run, to_rom=to_rom, running=running)
            yield from self._carried_out(steps)
        return comparison.differences()

    def _compared(self, settings: SettingsSource) -> Exchanges[_core.SettingsComparison]:
        steps = self._core.comparing(text_of(settings))
        comparison: _core.SettingsComparison = yield from self._carried_out(steps)
        return comparison

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuses a second restore of the same motor: each could undo what the other has written."""
        client, motor = self._motor.client, self._core.motor
        here = object()
        if client._restored.setdefault(motor, here) is not here:
            raise InvalidValueError(
                f"another restore of motor {motor} is in progress; nothing was sent",
                port=client.port,
                motor=motor,
            )
        try:
            yield
        finally:
            del client._restored[motor]

    def _carried_out(self, steps: _core.SettingsSteps) -> Exchanges[Any]:
        """Takes the steps. An exception that is not of this package ends them, after the roll-back."""
        motor, interruption = self._motor, None
        while True:
            try:
                step, value = steps.next()
            except SettingsError as error:
                error.port = motor.client.port
                if interruption is None:
                    raise
                raise interruption from error
            if step == "done":
                return value
            reply = b""
            try:
                if step == "ask":
                    reply = yield motor.client._exchange(*value)
                elif step == "check":
                    motor._check(*value)
                else:
                    yield motor._confirm()
            except GeneratorExit:
                raise
            except BaseException as error:
                if not isinstance(error, MotorlinkError):
                    interruption = error
                steps.failed(error)
            else:
                steps.answered(reply)

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Settings of {self._motor!r}>"


class Settings(Blocking, AnySettings):
    """The settings of a motor as text, from ``motor.settings``."""

    __slots__ = ()
