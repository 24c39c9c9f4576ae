"""Forked processes: the ports of the parent belong to the parent only."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorlink
from conftest import Served, eventually

BEGIN = """
    import asyncio, multiprocessing, os, signal, sys, motorlink

    def fork():
        \"\"\"A child that lives on, after this process has ended.\"\"\"
        if sys.argv[2] == "multiprocessing":
            child = multiprocessing.get_context("fork").Process(target=signal.pause)
            child.start()
            return child.pid
        ready, alive = os.pipe()
        child = os.fork()
        if child == 0:
            os.write(alive, b"x")
            signal.pause()
        # On a busy machine the child may not have run yet. Until then it has the ports of its parent.
        os.read(ready, 1)
        return child
"""

BLOCKING = """
    bus = motorlink.st.open(sys.argv[1])
    motor = bus.motor(1)
    motor.set_ramp(500, 0)
    motor.start()
    print(fork(), flush=True)
    signal.pause()
"""

ASYNC = """
    async def main():
        bus = await motorlink.aio.st.open(sys.argv[1])
        motor = bus.motor(1)
        await motor.set_ramp(500, 0)
        await motor.start()
        print(fork(), flush=True)
        signal.pause()
    asyncio.run(main())
"""


class Guard:
    """A guard between a drive and its client."""

    def __init__(self, command: str, drive: str, folder: Path):
        serve = ["--serve", f"pty:{folder}/guarded", "--serve", "tcp-listen:127.0.0.1:0"]
        words = [command, "guard", "-p", drive, *serve]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout
        lines = [json.loads(self.process.stdout.readline()) for _ in range(2)]
        self.ports = {"pty": f"{folder}/guarded", "tcp": lines[1]["port"].replace("-listen", "")}


@pytest.fixture
def guard(command: str, served: Served, tmp_path: Path) -> Iterator[Guard]:
    guard = Guard(command, served.st, tmp_path)
    yield guard
    guard.process.kill()
    guard.process.communicate()


class Family:
    """A program whose child still runs after the program was killed."""

    def __init__(self, script: str, port: str, way: str):
        words = [sys.executable, "-c", textwrap.dedent(BEGIN) + textwrap.dedent(script), port, way]
        self.parent = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert self.parent.stdout
        self.child = int(self.parent.stdout.readline())

    def kill_parent(self) -> None:
        self.parent.kill()
        self.parent.wait()

    def __enter__(self) -> Family:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill_parent()
        # It was running all the time.
        os.kill(self.child, signal.SIGKILL)
        assert self.parent.stdout
        self.parent.stdout.close()


@pytest.mark.parametrize(
    ("kind", "script", "way"),
    [("pty", BLOCKING, "fork"), ("tcp", ASYNC, "multiprocessing")],
    ids=["pty", "tcp"],
)
def test_a_guard_stops_the_motors_of_a_killed_parent(
    guard: Guard, served: Served, kind: str, script: str, way: str
) -> None:
    with Family(script, guard.ports[kind], way) as family:
        eventually(lambda: served.motor("st", 1)["status"] == "RUN", "a motor in RUN")
        family.kill_parent()
        eventually(lambda: served.motor("st", 1)["status"] == "IDLE", "a motor at rest")


def test_the_port_of_a_killed_parent_is_free(served: Served) -> None:
    with Family(BLOCKING, served.st, "fork") as family:
        with pytest.raises(motorlink.PortError, match="in use"):
            motorlink.st.open(served.st)
        family.kill_parent()
        with motorlink.st.open(served.st) as bus:
            bus.motor(1).stop()


CHILD_ENDS = """
    import gc, os, sys, motorlink
    bus = motorlink.rmd.open(sys.argv[1], timeout=2.0)
    bus.motor(1).set_speed(100)
    for way in range(3):
        child = os.fork()
        if child == 0:
            if way == 0:
                try:
                    bus.motor(1).stop()
                    os._exit(1)
                except motorlink.ClosedError as error:
                    assert "another process" in str(error)
                bus.close()
            elif way == 1:
                del bus
                gc.collect()
            sys.exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        print(bus.motor(1).motion_status().temperature_celsius > 0, bus.moving)
    bus.close()
"""


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_the_end_of_a_child_does_not_affect_the_adapter_of_the_parent(served: Served) -> None:
    words = [sys.executable, "-c", textwrap.dedent(CHILD_ENDS), served.can]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines() == ["True [1]"] * 3, done.stderr


ASYNC_CHILD = """
    import asyncio, os, sys, motorlink
    async def main():
        async with motorlink.aio.st.open(sys.argv[1]) as bus:
            child = os.fork()
            if child == 0:
                try:
                    bus.moving
                except motorlink.ClosedError as error:
                    print("another process" in str(error), flush=True)
                os._exit(0)
            os.waitpid(child, 0)
            print(bus.moving, await bus.motor(1).get("SPEED_MEAS"))
    asyncio.run(main())
"""


def test_a_client_of_asyncio_is_closed_in_a_child(served: Served) -> None:
    words = [sys.executable, "-c", textwrap.dedent(ASYNC_CHILD), served.st]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines() == ["True", "[] 0"], done.stderr
