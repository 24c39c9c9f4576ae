"""Drives that speak ST's serial Motor Control Protocol.

>>> import motorlink
>>> with motorlink.st.open("sim:") as bus:
...     motor = bus.motor(1)
...     motor.write("SPEED_KP", 1200)
...     motor.registers.SPEED_KP
1200

Paragraphs are those of the document "Motor Control Protocol".
"""

from __future__ import annotations

import os
from types import TracebackType
from typing import Any

from motorlink import _core
from motorlink._bus import end, on_close_checked, port_name
from motorlink._core import StRequest as Request

__all__ = ["Bus", "Motor", "Request", "open"]

_ON_CLOSE = ("stop", "nothing")


def open(
    port: str | os.PathLike[str],
    *,
    profile: str = "spec",
    timeout: float = 1.0,
    speed_limit: float | None = None,
    current_limit: float | None = None,
    full_scale_amps: float | None = None,
    recovery: str = "drain",
    on_close: str = "stop",
) -> Bus:
    """Opens a serial line with a drive. Nothing is sent.

    ``port``: ``/dev/ttyACM0``, ``serial:/dev/ttyUSB0?baud=115200``, ``tcp:HOST:PORT``, a pty, or
    ``sim:`` for a simulated drive inside the process.
    """
    on_close_checked(on_close, _ON_CLOSE)
    if current_limit is not None and full_scale_amps is not None:
        current_limit *= 32767 / full_scale_amps
    client = _core.StClient.open(
        port_name(port),
        profile=profile,
        timeout=timeout,
        recovery=recovery,
        speed_limit_rpm=speed_limit,
        current_limit_s16a=current_limit,
    )
    return Bus(client, profile=profile, full_scale_amps=full_scale_amps, on_close=on_close)


class Bus:
    """A serial line with a drive of up to seven motors. Threads may share it."""

    def __init__(
        self,
        client: _core.StClient,
        *,
        profile: str = "spec",
        full_scale_amps: float | None = None,
        on_close: str = "stop",
    ):
        self._client = client
        self._profile = profile
        self._full_scale_amps = full_scale_amps
        self._on_close = on_close_checked(on_close, _ON_CLOSE)

    def motor(self, number: int = 1, *, full_scale_amps: float | None = None) -> Motor:
        """A motor of the drive, 1 to 7."""
        return Motor(self, number, full_scale_amps or self._full_scale_amps)

    def perform(self, motor: int, request: Request) -> Any:
        """One exchange; gives what the request makes of the reply."""
        return self._client.perform(motor, request)

    def close(self) -> None:
        """Stops the motors that this bus started, if it was opened so, and closes the port."""
        self._end(in_flight=False)

    def _end(self, *, in_flight: bool) -> None:
        client = self._client
        if client.is_closed:
            return
        stop = client.stop_started if self._on_close == "stop" else list
        end(stop, client.close, client.port, in_flight=in_flight)

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end(in_flight=error is not None)


class Motor:
    """One motor of a drive."""

    def __init__(self, bus: Bus, number: int, full_scale_amps: float | None):
        self._bus = bus
        self._number = number
        self._full_scale_amps = full_scale_amps

    def read(self, register: str | int, *, raw: bool = False) -> float:
        """Reads a register (4.5)."""
        bus = self._bus
        request = Request.read(
            register, profile=bus._profile, raw=raw, full_scale_amps=self._full_scale_amps
        )
        value: float = bus.perform(self._number, request)
        return value
