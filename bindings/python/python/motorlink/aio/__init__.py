"""The same clients for asyncio: every exchange is awaited.

>>> import asyncio, motorlink
>>> async def main() -> float:
...     async with motorlink.aio.st.open("sim:") as client:       # or "/dev/ttyACM0"
...         motor = client.motor(1)
...         await motor.set_ramp(1500, 1.0)                        # rpm, s
...         return await motor.get("SPEED_MEAS")
>>> asyncio.run(main())
0

Methods, arguments, values, errors and docstrings are those of ``motorlink.st`` and ``motorlink.rmd``.
The examples in the docstrings use the blocking API. Two things differ: the ``registers`` of a motor are
names and facts only, and a bench of ``motorlink.sim`` is not a port.

The event loop watches the port's descriptor. Exchanges use no thread. Opening a port, a scan and the
end of ``async with`` can take long: they run in the loop's default executor.

An exchange can be cancelled at any moment: by ``asyncio.timeout``, by ``task.cancel()`` or by the end of
``asyncio.run``. It is then unknown whether the drive executed the request. A late reply is never taken
for the reply to another request, and the next caller does not wait. The end of ``async with`` stops the
motors that the client started, also in a cancelled task. The cancellation continues after that.

A client belongs to the event loop in which it was opened.
"""

from motorlink.aio import rmd, st
from motorlink.aio._sampling import Sampling
from motorlink.aio._settings import Settings

__all__ = ["Sampling", "Settings", "rmd", "st"]


def __dir__() -> list[str]:
    return __all__
