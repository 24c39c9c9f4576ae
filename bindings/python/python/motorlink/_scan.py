"""Scans for the baud rate of an ST drive, for both APIs."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Union

from motorlink import _core
from motorlink._apis import Exchanges
from motorlink._values import BoardInfo

Path = Union[str, "os.PathLike[str]"]


class ScanResult(NamedTuple):
    """The result of a scan for one baud rate."""

    baud: int
    #: ``drive``: a drive replied. ``refuses``: a drive refused GET_BOARD_INFO. ``garbage``: bytes that
    #: are not a reply, perhaps of another rate. ``echo``: the request came back. ``silence``: nothing
    #: came. ``impossible``: the port cannot have this rate.
    kind: str
    #: The board information of a drive, otherwise ``None``.
    board_info: BoardInfo | None


def scanning(
    ask: Callable[[str, int, float], Any], port: Path, rates: Sequence[int], timeout: float
) -> Exchanges[list[ScanResult]]:
    """Asks at one rate after the other."""
    name = os.fspath(port)
    results: list[ScanResult] = []
    for baud in _core.st_scan_rates(name, rates):
        results.append((yield ask(name, baud, timeout)))
    return results
