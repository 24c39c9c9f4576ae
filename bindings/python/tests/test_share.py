"""Lines of `motorlink share` as ports."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorlink
from conftest import Served, eventually
from motorlink import aio, errors


class Share:
    """A share of served drives."""

    def __init__(self, command: str, drives: Served, folder: Path):
        self.path = folder / "share"
        self.st, self.rmd = f"share:{self.path}/st0", f"share:{self.path}/rmd0"
        # The drives of a busy machine answer late.
        words = [command, "share", "-p", drives.st, "-p", drives.can, "--timeout", "1s", "--at", f"unix:{self.path}"]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout
        assert self.process.stdout.readline().startswith("share at ")

    def end(self) -> None:
        """Ends the share."""
        self.process.terminate()
        self.process.communicate(timeout=60)


@pytest.fixture
def share(command: str, served: Served, tmp_path: Path) -> Iterator[Share]:
    share = Share(command, served, tmp_path)
    yield share
    share.end()


MOVES = """
import signal, sys, motorlink
bus = motorlink.rmd.open(sys.argv[1], on_close="off")
bus.motor(4).set_speed(100)
print("moving", flush=True)
signal.pause()
"""


def test_refusals_are_exceptions_with_their_words(share: Share) -> None:
    with motorlink.st.open(share.st) as client:
        with pytest.raises(errors.RefusedError) as refused:
            client.motor(5).get("STATUS")
        assert refused.value.name == "BAD_MOTOR_SELECTED"
        client.confirm()
    with pytest.raises(errors.InvalidValueError, match="reads frames in profile spec"):
        motorlink.st.open(share.st, profile="mcsdk-5.4")
    with pytest.raises(errors.PortError, match="no share is at"):
        motorlink.st.open(f"share:{share.path}x/st0")
    with motorlink.rmd.open(share.rmd) as bus, pytest.raises(errors.ReplyTimeoutError):
        bus.motor(9).status()


def test_tasks_use_a_share(share: Share, served: Served) -> None:
    async def main() -> None:
        async with aio.st.open(share.st) as client, aio.rmd.open(share.rmd) as bus:
            motor = client.motor(1)
            # A busy machine may be late with a reply.
            values = await client.sample(["SPEED_KP", "BUS_VOLTAGE"], rate=50, seconds=0.5, on_error="skip")
            assert len(values) > 1 and set(values["BUS_VOLTAGE"]) == {325}
            await motor.set_ramp(1500, 0.1)
            await motor.start()
            for id in (1, 2, 3, 4):
                await bus.motor(id).status()
                await bus.confirm(id)
            assert len(await bus.scan([1, 2, 3, 4])) == 4
            while await motor.get("SPEED_MEAS") < 1000:
                await asyncio.sleep(0.01)
            quantities = {id: ["voltage_volts"] for id in (1, 2, 3, 4)}
            row = await bus.samples(quantities, rate=50, on_error="skip").__anext__()
            assert {row[f"voltage_volts_{id}"] for id in quantities} == {24}
            await client.confirm()
            await motor.stop()
        eventually(lambda: abs(served.rpm()) < 30, "a motor that stops")

    asyncio.run(asyncio.wait_for(main(), 60))


def test_the_end_of_a_program_is_that_of_the_motors_that_it_has(share: Share, served: Served) -> None:
    def mode(motor: int) -> str:
        return str(served.motor("rmd", motor)["mode"])

    # Another program moves motor 1 meanwhile, and holds a load with it.
    with motorlink.rmd.open(share.rmd) as other:
        with motorlink.rmd.open(share.rmd, on_close="off") as bus:
            for motor in (1, 2):
                bus.motor(motor).set_speed(100)
            other.motor(1).set_speed(200)
            other.motor(1).stop()
        eventually(lambda: mode(2) == "off", "the end of motor 2")
        assert mode(1) == "stopped"
    # What a program has declared holds if it is killed, too.
    words = [sys.executable, "-c", MOVES, share.rmd]
    moves = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert moves.stdout and moves.stdout.readline() == "moving\n"
    moves.kill()
    moves.communicate()
    eventually(lambda: mode(4) == "off", "the end of motor 4")


def test_a_program_that_sleeps_lives_and_a_stream_that_ends_does_not(share: Share, served: Served) -> None:
    def speed() -> float:
        return float(str(served.motor("rmd", 1)["speed_dps"]))

    with motorlink.rmd.open(share.rmd + "?deadline=400ms") as bus:
        bus.motor(1).set_speed(100)
        time.sleep(1)
        assert speed() > 50
    with motorlink.rmd.open(share.rmd + "?deadline=400ms&motion=300ms") as bus:
        for _ in range(5):
            bus.motor(1).set_speed(100)
            time.sleep(0.1)
        assert speed() > 50
        eventually(lambda: abs(speed()) < 5, "a motor whose stream has ended")
        with pytest.raises(errors.PortError, match="no new command for 3"):
            bus.motor(1).set_speed(100)


def test_the_end_of_a_share_is_told(share: Share) -> None:
    with motorlink.st.open(share.st, on_close="nothing") as client:
        client.motor(1).status()
        share.process.kill()
        share.process.communicate()
        with pytest.raises(errors.PortError, match="the share is gone"):
            client.motor(1).status()
