"""What drives answer. The unit of each number is the end of its name."""

from __future__ import annotations

from typing import NamedTuple

from motorlink import _core


class Word(str):
    """A value that the protocol has a word for. It is that word: ``status == "RUN"``.

    A number without a word survives as such: ``0x63``.
    """

    #: The number on the wire.
    number: int
    #: What it means, in a few words; empty for a number without a word.
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
    """State of an ST drive's state machine: ``IDLE``, ``RUN``, ``FAULT_NOW`` (register STATUS)."""


class ControlMode(Word):
    """``TORQUE`` or ``SPEED``: what an ST drive follows (register CONTROL_MODE)."""


class Flags(NamedTuple):
    """Faults of an ST drive (register FLAGS). False when there are none."""

    #: Faults since they were last acknowledged, by name: ``OVER_VOLT``.
    occurred: tuple[str, ...]
    #: Faults whose cause is still there.
    present: tuple[str, ...]
    #: The 32 bits of the register: occurred below, present above.
    bits: int

    def __bool__(self) -> bool:
        return self.bits != 0

    def __str__(self) -> str:
        return _core.st_flags_text(self.bits)


class BoardInfo(NamedTuple):
    """Version and name of the drive's SDK (Motor Control Protocol, 4.7)."""

    #: Major, minor, patch.
    version: tuple[int, int, int]
    name: str


class FirmwareVersion(NamedTuple):
    """Name and version of the drive's firmware (Motor Control Protocol, 4.12)."""

    name: str
    version: str


class RevupPhase(NamedTuple):
    """A phase of the rev-up (Motor Control Protocol, 4.9).

    ``torque`` is Iq at the end of the phase: digits of the drive (s16A), or A for a motor with
    ``full_scale_amps``.
    """

    #: Mechanical speed at the end of the phase.
    speed_rpm: int
    torque: float
    duration_s: float


class Errors(NamedTuple):
    """Protections of an RMD motor that are active. False when there are none.

    As text it has the document's words: ``low voltage protection``.
    """

    #: ``LOW_VOLTAGE``, ``OVER_TEMPERATURE``.
    names: tuple[str, ...]
    #: The bits of the error byte, also those that mean nothing.
    bits: int

    def __bool__(self) -> bool:
        return bool(self.names)

    def __str__(self) -> str:
        return _core.rmd_errors_text(self.bits)


class RegisterInfo(NamedTuple):
    """A register of an ST drive (Motor Control Protocol, table 3)."""

    #: The number on the wire.
    id: int
    name: str
    #: Unit of the value as this motor reads it; empty when there is none.
    unit: str
    #: ``i16``, ``u32``, ``f32``.
    type: str
    #: ``RW``, ``R``, ``W``; ``D``: only on the DAC and in data segments; ``-``: firmware names it only.
    access: str
    #: What it is, in a few words.
    doc: str
    #: What the drive must be built with.
    feature: str
    #: Whether a drive of this profile, so built, answers when it is read.
    readable: bool
    #: Whether a drive of this profile, so built, takes a value.
    writable: bool


class Frame(NamedTuple):
    """An RMD frame in words, from ``motorlink.rmd.decode``."""

    #: The motor; ``None`` for the frame 0x280 to motors 1 to 4.
    motor: int | None
    #: The document's name of the command; ``0x280`` for the frame to four motors.
    name: str
    #: The values by name, in their units.
    values: dict[str, float]
    #: The values by name, in digits.
    digits: dict[str, int]
    #: All of it as text.
    text: str
