"""Values of replies. The end of a name is the unit."""

from __future__ import annotations

from typing import NamedTuple

from motorlink import _core


class Word(str):
    """A value that the protocol has a word for. It compares as that word: ``status == "RUN"``.

    A number without a word is its hexadecimal text: ``0x63``.
    """

    #: The number on the wire.
    number: int
    #: A short description; empty for a number without a word.
    doc: str

    def __new__(cls, word: str, number: int = 0, doc: str = "") -> Word:
        self = super().__new__(cls, word)
        self.number = number
        self.doc = doc
        return self

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})"

    def __reduce__(self) -> tuple[type[Word], tuple[str, int, str]]:
        return type(self), (str(self), self.number, self.doc)


class Status(Word):
    """State of an ST drive: ``IDLE``, ``RUN``, ``FAULT_NOW`` (register STATUS)."""


class ControlMode(Word):
    """Control mode of an ST drive: ``TORQUE`` or ``SPEED`` (register CONTROL_MODE)."""


class Flags(NamedTuple):
    """Faults of an ST drive (register FLAGS). False if there are none."""

    #: Faults since they were last acknowledged, by name: ``OVER_VOLT``.
    occurred: tuple[str, ...]
    #: Faults that are still present.
    present: tuple[str, ...]
    #: The 32 bits of the register: the lower half occurred, the upper half is present.
    bits: int

    def __bool__(self) -> bool:
        return self.bits != 0

    def __str__(self) -> str:
        return _core.st_flags_text(self.bits)


class BoardInfo(NamedTuple):
    """Version and name of the drive's SDK (4.7)."""

    #: Major, minor, patch.
    version: tuple[int, int, int]
    name: str


class FirmwareVersion(NamedTuple):
    """Name and version of the drive's firmware (4.12)."""

    name: str
    version: str


class RevupPhase(NamedTuple):
    """A phase of the rev-up (4.9).

    ``torque`` is Iq at the end of the phase, in A with ``full_scale_amps``, otherwise in digits.
    """

    #: Mechanical speed at the end of the phase, rpm.
    speed_rpm: int
    torque: float
    duration_s: float


class Errors(NamedTuple):
    """Active protections of an RMD motor. False if there are none.

    Its text has the document's words: ``low voltage protection``.
    """

    #: ``LOW_VOLTAGE``, ``OVER_TEMPERATURE``.
    names: tuple[str, ...]
    #: The bits of the error byte, also those without a meaning.
    bits: int

    def __bool__(self) -> bool:
        return bool(self.names)

    def __str__(self) -> str:
        return _core.rmd_errors_text(self.bits)


class RegisterInfo(NamedTuple):
    """A register of an ST drive (table 3)."""

    #: The number on the wire.
    id: int
    name: str
    #: Unit of the value of this motor; empty if there is none.
    unit: str
    #: The type on the wire: ``i16``, ``u32``, ``f32``.
    type: str
    #: ``RW``, ``R``, ``W``. ``D``: only on the DAC and in data segments. ``-``: only named by firmware.
    access: str
    #: A short description.
    doc: str
    #: The feature that the drive must be built with; empty if none.
    feature: str
    #: Whether a drive of this profile with the feature can read it.
    readable: bool
    #: Whether a drive of this profile with the feature can write it.
    writable: bool


class Frame(NamedTuple):
    """An RMD frame as text and values, from :func:`motorlink.rmd.decode`."""

    #: The motor ID; ``None`` for the frame 0x280 to motors 1 to 4.
    motor: int | None
    #: The document's name of the command; ``0x280`` for the frame to four motors.
    name: str
    #: The values by name, in their units.
    values: dict[str, float]
    #: The values by name, in digits.
    digits: dict[str, int]
    #: The frame as text.
    text: str
