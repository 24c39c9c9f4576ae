"""The same clients for programs that use asyncio: every exchange is awaited.

>>> import asyncio, motorlink
>>> async def main() -> float:
...     async with motorlink.aio.st.open("sim:") as client:       # or "/dev/ttyACM0"
...         motor = client.motor(1)
...         await motor.set_ramp(1500, 1.0)                        # rpm, s
...         return await motor.get("SPEED_MEAS")
>>> asyncio.run(main())
0

Methods, arguments, values and exceptions are those of ``motorlink.st`` and ``motorlink.rmd``, checked
by the same code, and so are their descriptions; examples there are of the blocking API. Different here: a
motor's ``registers`` are names and what they stand for, and a bench of ``motorlink.sim`` is not a
port. No thread carries an exchange: the loop watches the
port's descriptor. Only opening a port, a scan, and the end of ``async with``, which
may wait for long, happen in the loop's default executor.

Any exchange may be cancelled, at any moment, by ``asyncio.timeout``, ``task.cancel()`` or the end of
``asyncio.run``. Nobody knows then whether the drive did what was asked; its reply, if it comes, is never
taken for that to another request; and the next caller has its turn at once. The end of ``async with``
stops the motors that the client started also in a task that is being cancelled, before it lets the
cancellation go on.

A client belongs to the event loop in which it was opened.
"""

from motorlink.aio import rmd, st
from motorlink.aio._sampling import Sampling

__all__ = ["Sampling", "rmd", "st"]


def __dir__() -> list[str]:
    return __all__
