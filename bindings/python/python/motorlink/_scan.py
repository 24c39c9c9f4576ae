"""Which baud rate does an ST drive speak? For both APIs."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Union

from motorlink import _core
from motorlink._apis import Exchanges
from motorlink._values import BoardInfo

Path = Union[str, "os.PathLike[str]"]


class ScanResult(NamedTuple):
    """What a baud rate was answered with."""

    baud: int
    #: ``drive``; ``refuses``: a drive that refuses GET_BOARD_INFO; ``garbage``: bytes that are not a
    #: reply, so perhaps another rate; ``echo``: the question came back; ``silence``; ``impossible``: the
    #: port cannot be set to the rate.
    kind: str
    #: Of a drive.
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
