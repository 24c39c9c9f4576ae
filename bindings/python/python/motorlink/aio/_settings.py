"""Settings of a motor in an event loop."""

from __future__ import annotations

from motorlink._apis import Awaited
from motorlink._settings import AnySettings


class Settings(Awaited, AnySettings):
    """The settings of a motor as text, from ``motor.settings``. See :class:`motorlink.Settings`."""

    __slots__ = ()
