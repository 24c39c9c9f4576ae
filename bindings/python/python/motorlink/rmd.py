"""RMD motors on a CAN bus, protocol V1.62."""

from __future__ import annotations

import os
from types import TracebackType
from typing import Any

from motorlink import _core
from motorlink._bus import end, on_close_checked, port_name
from motorlink._core import RmdRequest as Request

__all__ = ["Bus", "Request", "open"]

_ON_CLOSE = ("stop", "off", "nothing")


def open(
    port: str | os.PathLike[str],
    *,
    timeout: float = 0.05,
    guard: float = 0.1,
    current_limit: float | None = None,
    speed_limit: float | None = None,
    angle_limit: float | None = None,
    on_close: str = "stop",
) -> Bus:
    """Opens a CAN bus. Nothing is sent."""
    on_close_checked(on_close, _ON_CLOSE)
    core = _core.RmdBus.open(
        port_name(port),
        timeout=timeout,
        guard=guard,
        current_limit_a=current_limit,
        speed_limit_dps=speed_limit,
        angle_limit_deg=angle_limit,
    )
    return Bus(core, on_close=on_close)


class Bus:
    """A CAN bus with RMD motors. Threads may share it."""

    def __init__(self, core: _core.RmdBus, *, on_close: str = "stop"):
        self._core = core
        self._on_close = on_close_checked(on_close, _ON_CLOSE)

    def perform(self, motor: int, request: Request) -> Any:
        """One exchange; gives what the request makes of the reply."""
        return self._core.perform(motor, request)

    def close(self) -> None:
        """Stops the motors that this bus was used to move, and closes the port."""
        self._end(in_flight=False)

    def _end(self, *, in_flight: bool) -> None:
        core = self._core
        if core.is_closed:
            return
        off = self._on_close == "off"
        stop = list if self._on_close == "nothing" else lambda: core.stop_moving(off=off)
        end(stop, core.close, core.port, in_flight=in_flight)

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end(in_flight=error is not None)
