"""Recordings of motors: MCAP files, and NumPy arrays of them.

>>> import motorlink
>>> run = motorlink.read("run.mcap")                     # doctest: +SKIP
>>> run["st0/motor1"]["SPEED_MEAS"].mean()               # doctest: +SKIP
1499.6

docs/RECORDING.md says what a file contains.
"""

from motorlink.recording._frames import Frame, Frames
from motorlink.recording._read import Drive, Event, Recording, Table, read
from motorlink.recording._record import Recorder, Status, record

__all__ = [
    "Drive",
    "Event",
    "Frame",
    "Frames",
    "Recorder",
    "Recording",
    "Status",
    "Table",
    "read",
    "record",
]


def __dir__() -> list[str]:
    return __all__
