"""Waiting until a motor has arrived, for both protocols and both APIs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorlink._apis import Exchanges
from motorlink.errors import LinkError, MotorlinkError, ReplyTimeoutError


def arrived(
    client: Any,
    watch: Any,
    ask: Callable[[Any], Any],
    confirm: Callable[[], Any],
) -> Exchanges[Any]:
    """Carries out the steps of ``watch`` until the motor has arrived. Returns the result of the watch.

    Raises ``NotArrivedError``, or the last error of the line if the motor is silent.
    """
    error: MotorlinkError = LinkError("the motor does not answer", port=client.port)
    while True:
        step, value = watch.next(client._now())
        if step == "done":
            return value
        if step == "silent":
            raise error
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
            error = failed
            watch.lost(client._now())
