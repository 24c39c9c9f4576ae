"""Moves that wait until a motor has arrived, for both protocols and both APIs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorlink import _core
from motorlink._apis import Exchanges
from motorlink.errors import InvalidValueError, LinkError, MotorlinkError, ReplyTimeoutError


def needs_wait(wait: bool, **arguments: object) -> None:
    """Refuses arguments that have an effect with ``wait=True`` only."""
    given = [name for name, value in arguments.items() if value is not None]
    if given and not wait:
        names = " and ".join(given)
        raise InvalidValueError(f"{names} without wait=True; add wait=True; nothing was sent")


def moved(
    client: Any,
    watch: _core.Arrival,
    ask: Callable[[Any], Any],
    confirm: Callable[[], Any],
    command: Exchanges[Any],
) -> Exchanges[Any]:
    """Reads the motor, carries out ``command``, and follows the motor until it has arrived.

    Returns the result of the watch. Raises ``NotArrivedError``, or the last error of the line if the motor is
    silent.
    """
    error: MotorlinkError = LinkError("the motor does not answer", port=client.port)
    is_commanded = False
    while True:
        step, value = watch.next(client._now())
        if step == "done":
            return value
        if step == "silent":
            raise error
        if step == "command":
            yield from command
            watch.commanded(client._now())
            is_commanded = True
            continue
        try:
            if step == "wait":
                yield client._pause(value)
            elif step == "ask":
                reply = yield ask(value)
                watch.replied(client._now(), reply)
            else:
                yield confirm()
                watch.confirmed(client._now())
        except (LinkError, ReplyTimeoutError) as failed:
            if not is_commanded:
                raise
            error = failed
            watch.lost(client._now())
