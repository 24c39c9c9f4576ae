"""The exceptions of this package. Each is a :class:`MotorlinkError`. There is one warning:
:class:`RecordingWarning`.

After :class:`RefusedError` the drive has not executed the request. After :class:`LinkError` and
:class:`ReplyTimeoutError` it is unknown whether the drive executed it.
"""

from __future__ import annotations

import pathlib
from typing import Any

__all__ = [
    "ClosedError",
    "FullTurnError",
    "ImplausibleValueError",
    "InvalidValueError",
    "LinkError",
    "MotorlinkError",
    "NotArrivedError",
    "PortError",
    "RecordingError",
    "RecordingWarning",
    "RefusedError",
    "ReplyTimeoutError",
    "SettingsError",
    "UnknownRegisterError",
]


def __dir__() -> list[str]:
    return __all__


class MotorlinkError(Exception):
    """The base of all exceptions. The message says what happened, where, and what to try."""

    #: The port's name; ``None`` if the error has none.
    port: str | None
    #: The motor's number; ``None`` if the error has none, or for the motor that the drive has selected.
    motor: int | None
    #: The rows that ``client.sample`` read before the error, otherwise ``None``.
    samples: Any

    def __init__(self, message: str = "", *, port: str | None = None, motor: int | None = None):
        super().__init__(message)
        self.port = port
        self.motor = motor
        self.samples = None


class RefusedError(MotorlinkError):
    """The drive refused the request, or did not keep a value. The line works.

    RMD motors never refuse. A motor that does not know a command does not reply:
    :class:`ReplyTimeoutError`.
    """

    #: The drive's error code (table 2); ``None`` if it sent none.
    code: int | None
    #: The document's name of the code, such as ``WRONG_SET``; ``None`` for a code without a name.
    name: str | None

    def __init__(
        self,
        message: str = "",
        *,
        port: str | None = None,
        motor: int | None = None,
        code: int | None = None,
        name: str | None = None,
    ):
        super().__init__(message, port=port, motor=motor)
        self.code = code
        self.name = name


class ImplausibleValueError(MotorlinkError):
    """The value of a register is not possible in this profile, but in another one. The line works.

    The drive may follow that profile. The message has the value in both. ``raw=True`` returns the digits.
    """

    #: The register's name.
    register: str
    #: The raw digits.
    digits: int
    #: The profile to try.
    profile: str

    def __init__(
        self,
        message: str = "",
        *,
        port: str | None = None,
        motor: int | None = None,
        register: str = "",
        digits: int = 0,
        profile: str = "",
    ):
        super().__init__(message, port=port, motor=motor)
        self.register = register
        self.digits = digits
        self.profile = profile


class NotArrivedError(MotorlinkError):
    """A motor did not arrive at its target in time, or stopped before it. The message says why.

    The motor still has its command. ``motor.stop()`` stops it; so does the end of ``with``.
    """


class LinkError(MotorlinkError, ConnectionError):
    """The line failed: no valid reply arrived. Reasons are damage, noise, or a port that was unplugged.

    Try again: the next call resynchronises the line first, and never takes a late reply for its own.
    """


class ReplyTimeoutError(MotorlinkError, TimeoutError):
    """No reply within the timeout. The device may be absent, unpowered, or at another baud rate."""


class PortError(LinkError):
    """The port cannot be opened, or its far end closed it."""


class InvalidValueError(MotorlinkError, ValueError):
    """A value cannot be sent, or a limit forbids it. Nothing was sent."""


class FullTurnError(InvalidValueError):
    """A move within the turn of an RMD motor could be nearly a full turn. It was not sent.

    The motor is at its target, or just past it. Only its angle was read.
    """


class UnknownRegisterError(InvalidValueError, KeyError):
    """The name or number of a register is unknown. Nothing was sent."""

    # KeyError would quote the message.
    __str__ = Exception.__str__


class SettingsError(MotorlinkError):
    """Settings were not restored, or could not be read. The message says which values the motor has.

    All attributes are empty if nothing was changed. The cause (``__cause__``) is the exception of the
    exchange that failed, if one did.
    """

    #: Names of settings that were written and have their old values again.
    rolled_back: tuple[str, ...]
    #: Names of settings that have the values of the file.
    changed: tuple[str, ...]
    #: Names of settings whose values are unknown: the old or the new ones.
    unknown: tuple[str, ...]
    #: Names of settings whose values in ROM are unknown.
    unknown_in_rom: tuple[str, ...]

    def __init__(self, message: str = "", *, port: str | None = None, motor: int | None = None):
        super().__init__(message, port=port, motor=motor)
        self.rolled_back = self.changed = self.unknown = self.unknown_in_rom = ()


class RecordingError(MotorlinkError, OSError):
    """A recording cannot be read or written. What was written stays readable.

    ``errno`` is the number that the system gave, such as ``errno.ENOSPC`` or ``errno.EEXIST``, if it gave
    one.
    """

    #: The file.
    path: pathlib.Path

    def __init__(self, message: str = "", *, port: str | None = None, motor: int | None = None):
        super().__init__(message, port=port, motor=motor)
        self.path = pathlib.Path()


class RecordingWarning(RuntimeWarning):
    """A part of a recording could not be read. The message says what is lost."""


class ClosedError(MotorlinkError, ValueError):
    """This program closed the client. Open it again."""
