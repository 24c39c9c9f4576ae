"""The frames of a recorded line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, overload

import numpy as np
import numpy.typing as npt

from motorlink import _core


class Frame(NamedTuple):
    """A recorded frame, or bytes that are none."""

    #: Time since the start of the recording, s.
    t: float
    #: ``SENT`` or ``RECEIVED``, from the point of view of the program that recorded.
    direction: str
    #: The CAN identifier. Bit 31: it has 29 bits; bit 30: a remote request. 0 on a serial line.
    id: int
    #: ``FRAME``, ``NACK``, ``DAMAGED``, or ``FOREIGN`` (docs/RECORDING.md).
    result: str
    #: The bytes on a serial line, the data of a CAN frame.
    data: bytes


class Frames(Sequence[Frame]):
    """The frames of a line in the order of time, from :meth:`Recording.frames`.

    ``frames[0]`` is a :class:`Frame`. The columns are NumPy arrays.
    """

    #: Time since the start of the recording, s.
    t: npt.NDArray[np.float64]
    #: ns since 1970.
    time_ns: npt.NDArray[np.int64]
    #: The numbers of directions: places in :attr:`DIRECTIONS`.
    direction: npt.NDArray[np.uint8]
    #: CAN identifiers with their flags, as in :class:`Frame`.
    id: npt.NDArray[np.uint32]
    #: The numbers of results: places in :attr:`RESULTS`.
    result: npt.NDArray[np.uint8]
    #: The names of directions.
    DIRECTIONS: tuple[str, ...] = tuple(_core.recorded_directions())
    #: The names of results.
    RESULTS: tuple[str, ...] = tuple(_core.recorded_results())

    def __init__(
        self,
        zero_ns: int,
        times: bytearray,
        directions: bytearray,
        ids: bytearray,
        results: bytearray,
        begins: bytearray,
        data: bytes,
    ):
        self.time_ns = np.frombuffer(times, np.int64)
        self.t = (self.time_ns - zero_ns) / 1e9
        self.direction = np.frombuffer(directions, np.uint8)
        self.id = np.frombuffer(ids, np.uint32)
        self.result = np.frombuffer(results, np.uint8)
        self._begins = np.frombuffer(begins, np.int64)
        self._data = data

    def data(self, place: int) -> bytes:
        """The bytes of a frame."""
        place = range(len(self))[place]
        return self._data[self._begins[place] : self._begins[place + 1]]

    def __len__(self) -> int:
        return len(self.time_ns)

    @overload
    def __getitem__(self, place: int) -> Frame: ...
    @overload
    def __getitem__(self, place: slice) -> list[Frame]: ...
    def __getitem__(self, place: int | slice) -> Frame | list[Frame]:
        if isinstance(place, slice):
            return [self[one] for one in range(len(self))[place]]
        place = range(len(self))[place]
        return Frame(
            t=float(self.t[place]),
            direction=self.DIRECTIONS[self.direction[place]],
            id=int(self.id[place]),
            result=self.RESULTS[self.result[place]],
            data=self.data(place),
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[place] for place in range(len(self)))
