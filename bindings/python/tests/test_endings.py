"""Motors stop at each end of a client: close, garbage collection, end of the program."""

from __future__ import annotations

import contextlib
import gc
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

import motorlink
from conftest import Served, eventually
from motorlink import rmd, sim, st


def start(bus: st.Client | rmd.Client) -> None:
    """Sets a motor of a bench turning."""
    if isinstance(bus, rmd.Client):
        bus.motor(1).set_speed(100)
    else:
        bus.motor(2).set_ramp(500, 0)
        bus.motor(2).start()


def is_turning(bench: sim.Bench, bus: str) -> bool:
    bench.run(0.5)
    if bus == "rmd":
        return abs(float(bench.truth("rmd1")["speed_dps"])) > 1
    return bench.truth("st2")["status"] not in ("IDLE", "STOP", "STOP_IDLE")


#: Opens a client of each protocol on a bench.
OPEN: dict[str, Callable[[sim.Bench], st.Client | rmd.Client]] = {"st": st.open, "rmd": rmd.open}


@pytest.mark.parametrize("kind", OPEN)
def test_a_motor_started_during_the_close_does_not_turn(kind: str) -> None:
    for _ in range(8):
        bench = sim.Bench()
        bus = OPEN[kind](bench)
        going = threading.Event()

        def use(bus: st.Client | rmd.Client = bus, going: threading.Event = going) -> None:
            with pytest.raises(motorlink.ClosedError):
                while True:
                    # The close may be stopping the motor, which refuses a start.
                    with contextlib.suppress(motorlink.RefusedError):
                        start(bus)
                    going.set()

        threads = [threading.Thread(target=use) for _ in range(3)]
        for thread in threads:
            thread.start()
        assert going.wait(10)
        bus.close()
        assert not is_turning(bench, kind)
        for thread in threads:
            thread.join(10)


@pytest.mark.parametrize("kind", OPEN)
def test_a_client_that_is_garbage_collected_stops_its_motors(kind: str) -> None:
    bench = sim.Bench()
    bus = OPEN[kind](bench)
    start(bus)
    assert is_turning(bench, kind)
    del bus
    gc.collect()
    assert not is_turning(bench, kind)


def test_on_close_nothing_also_holds_for_garbage_collection() -> None:
    bench = sim.Bench()
    bus = rmd.open(bench, on_close="nothing")
    bus.motor(1).set_speed(100)
    del bus
    gc.collect()
    assert is_turning(bench, "rmd")


BLOCKING = """\
import sys, motorlink
bus = motorlink.rmd.open(sys.argv[1], timeout=2.0)
bus.motor(1).set_speed(360)
print(bus.moving)
"""

ASYNC = """\
import asyncio, sys, motorlink.aio
async def main():
    bus = await motorlink.aio.rmd.open(sys.argv[1], timeout=2.0)
    await bus.motor(1).set_speed(360)
    print(bus.moving)
asyncio.run(main())
"""


@pytest.mark.parametrize("script", [BLOCKING, ASYNC], ids=["blocking", "asyncio"])
def test_a_program_that_ends_without_closing_stops_its_motors(served: Served, script: str) -> None:
    words = [sys.executable, "-c", script, served.can]
    out = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout
    assert out == "[1]\n"

    def speed() -> float:
        told = served.motor("rmd", 1)["speed_dps"]
        assert isinstance(told, float)
        return told

    eventually(lambda: abs(speed()) < 1, "a motor at rest")


def test_a_signal_handler_may_close_a_client_that_samples() -> None:
    script = "\n".join((
        "import os, signal, threading, motorlink",
        "for kind, what in (('st', 'SPEED_MEAS'), ('rmd', 'iq_amps')):",
        "    bus = getattr(motorlink, kind).open('sim:')",
        "    signal.signal(signal.SIGTERM, lambda *_: bus.close())",
        "    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM)).start()",
        "    try:",
        "        bus.sample([what], rate=100, seconds=600)",
        "    except motorlink.ClosedError as error:",
        "        print(len(error.samples) > 0)",
    ))
    words = [sys.executable, "-c", script]
    out = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout
    assert out == "True\nTrue\n"
