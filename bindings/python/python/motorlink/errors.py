"""What can go wrong. Every exception of this package is a :class:`MotorlinkError`.

A drive that refuses is told apart from a line that fails: after :class:`RefusedError` the drive is as it
was, after :class:`LinkError` and :class:`ReplyTimeoutError` nobody knows whether it did what was asked.
"""

from __future__ import annotations

from typing import Any

__all__ = [
    "ClosedError",
    "FullTurnError",
    "InvalidValueError",
    "LinkError",
    "MotorlinkError",
    "PortError",
    "RefusedError",
    "ReplyTimeoutError",
    "UnknownRegisterError",
]


def __dir__() -> list[str]:
    return __all__


class MotorlinkError(Exception):
    """Something did not work; the message says what, where, and what to try."""

    #: The port, as messages name it; ``None`` where there is none.
    port: str | None
    #: The motor; ``None`` where it is about none, or about whichever the drive has selected.
    motor: int | None
    #: What was sampled before it happened, if it happened in ``client.sample``.
    samples: Any

    def __init__(self, message: str = "", *, port: str | None = None, motor: int | None = None):
        super().__init__(message)
        self.port = port
        self.motor = motor
        self.samples = None


class RefusedError(MotorlinkError):
    """The drive understood and said no, or did not keep what it was told; the line works.

    RMD motors never refuse: one that does not know a command is silent (:class:`ReplyTimeoutError`).
    """

    #: The drive's reason (Motor Control Protocol, table 2); ``None`` where it gave none.
    code: int | None
    #: The document's name for it, such as ``WRONG_SET``; ``None`` for a code without a name.
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


class LinkError(MotorlinkError, ConnectionError):
    """There is no answer to trust: damage, noise, a port that went away.

    Call again: the line is recovered first, so that a late reply is never taken for another's.
    """


class ReplyTimeoutError(MotorlinkError, TimeoutError):
    """No answer in time. What is not there, not powered or of another baud rate is silent, too."""


class PortError(LinkError):
    """The port cannot be opened, or was closed by its far end."""


class InvalidValueError(MotorlinkError, ValueError):
    """A value that cannot be sent, or that a limit forbids; nothing was sent."""


class FullTurnError(InvalidValueError):
    """A move within the turn of an RMD motor that could be nearly a full turn; it was not sent.

    The motor is at its target already, or just past it. Only its angle was read.
    """


class UnknownRegisterError(InvalidValueError, KeyError):
    """A register name or number that nobody knows; nothing was sent."""

    # That of KeyError quotes the message.
    __str__ = Exception.__str__


class ClosedError(MotorlinkError, ValueError):
    """The client was closed by this program; open it again."""
