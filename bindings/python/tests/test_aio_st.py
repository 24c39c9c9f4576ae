"""asyncio on serial lines: each caller gets its own reply, also after cancellations."""

from __future__ import annotations

import asyncio
import os
import random
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from drive import REGISTERS, START, STOP, Drive, value

import motorlink
from motorlink import aio
from motorlink.aio._steps import Steps

T = TypeVar("T")


@pytest.fixture
def drives(tmp_path: Path) -> Iterator[list[Drive]]:
    """Two drives with different values."""
    drives = [Drive(tmp_path / f"st{number}", number) for number in (2, 3)]
    yield drives
    for drive in drives:
        drive.unplug()


@pytest.fixture
def drive(drives: list[Drive]) -> Drive:
    return drives[1]


async def within(seconds: float, awaitable: Awaitable[T]) -> T:
    """A test that hangs fails."""
    return await asyncio.wait_for(awaitable, seconds)


async def asked(bus: aio.st.Client, drive: Drive, choice: random.Random) -> None:
    """One exchange with any motor, checked."""
    motor, (name, number) = choice.randrange(1, 8), choice.choice(sorted(REGISTERS.items()))
    assert await bus.motor(motor).get(name) == value(drive.number, motor, number)


def test_cancelled_exchanges_do_not_affect_others(drives: list[Drive]) -> None:
    """Replies have a delay of up to 8 ms. Tasks are cancelled after up to 6 ms."""
    rng = random.Random(1)
    for drive in drives:
        drive.delay = lambda: rng.choice([0, 0.002, 0.008])
    cancelled = answered = 0

    async def caller(bus: aio.st.Client, drive: Drive, choice: random.Random) -> None:
        nonlocal cancelled, answered
        for _ in range(5):
            task = asyncio.ensure_future(asked(bus, drive, choice))
            if choice.random() < 0.4:
                await asyncio.sleep(choice.random() * 0.006)
                task.cancel()
            try:
                await task
                answered += 1
            except asyncio.CancelledError:
                cancelled += 1

    async def main() -> None:
        loop = asyncio.get_running_loop()
        # The first client of a program opens a pair of sockets for signals, which stays.
        await (await aio.st.open("sim:")).close()
        before = os.listdir("/proc/self/fd")
        buses = [await aio.st.open(drive.path) for drive in drives]
        callers = [
            caller(bus, drive, random.Random(rng.random()))
            for bus, drive in zip(buses, drives)
            for _ in range(4)
        ]
        await within(60, asyncio.gather(*callers))
        for bus, drive in zip(buses, drives):
            await within(10, asked(bus, drive, rng))
            descriptor = bus._core.fileno()
            assert descriptor is not None
            await bus.close()
            assert not loop.remove_reader(descriptor), "nothing watches it any more"
        # Those of earlier tests may be closed meanwhile.
        assert set(os.listdir("/proc/self/fd")) <= set(before)

    asyncio.run(within(60, main()))
    assert cancelled and answered


def test_exchanges_run_in_the_order_of_the_calls_and_a_cancelled_call_sends_nothing(drive: Drive) -> None:
    async def main() -> None:
        order: list[int] = []

        async def start(bus: aio.st.Client, motor: int) -> None:
            await bus.motor(motor).start()
            order.append(motor)

        async with aio.st.open(drive.path, on_close="nothing") as bus:
            starts = [asyncio.ensure_future(start(bus, motor)) for motor in range(1, 8)]
            await asyncio.sleep(0)
            # It waits for its turn.
            starts[3].cancel()
            await asyncio.gather(*starts, return_exceptions=True)
        assert starts[3].cancelled() and order == [1, 2, 3, 5, 6, 7]
        assert drive.executed == [(motor, START) for motor in order]

    asyncio.run(within(60, main()))


def test_a_task_that_is_cancelled_repeatedly_still_stops_its_motor(drive: Drive) -> None:
    async def work(running: asyncio.Event) -> None:
        async with aio.st.open(drive.path) as bus:
            await bus.motor(1).start()
            drive.delay = lambda: 0.05
            running.set()
            while True:
                await bus.motor(1).get("SPEED_MEAS")

    async def main() -> None:
        running = asyncio.Event()
        task = asyncio.ensure_future(work(running))
        await within(10, running.wait())
        while not task.done():
            task.cancel()
            await asyncio.sleep(0.01)
        assert task.cancelled()
        # After an abandoned exchange the stop is also sent before the line is resynchronised.
        first, *stops = drive.executed
        assert first == (1, START) and set(stops) == {(1, STOP)}

    asyncio.run(within(60, main()))


def test_the_end_of_the_loop_still_stops_the_motor_of_a_task(drive: Drive) -> None:
    async def work(running: asyncio.Event) -> None:
        async with aio.st.open(drive.path) as bus:
            await bus.motor(1).start()
            running.set()
            await asyncio.sleep(3600)

    async def main() -> None:
        running = asyncio.Event()
        main.task = asyncio.ensure_future(work(running))  # type: ignore[attr-defined]
        await within(10, running.wait())

    asyncio.run(within(60, main()))
    assert drive.executed == [(1, START), (1, STOP)]


def test_close_ends_the_exchanges_of_others(drive: Drive) -> None:
    async def main() -> None:
        drive.delay = lambda: 0.5
        bus = await aio.st.open(drive.path)
        waiting = [asyncio.ensure_future(bus.motor(n).get("SPEED_REF")) for n in (1, 2)]
        await asyncio.sleep(0.01)
        await bus.close()
        for task in waiting:
            with pytest.raises(motorlink.ClosedError):
                await task
        await bus.close()

    asyncio.run(within(60, main()))


def test_a_lost_port_is_opened_again(drive: Drive) -> None:
    async def is_right(motor: aio.st.Motor) -> bool:
        while True:
            try:
                return await motor.get("SPEED_REF") == value(3, 1, REGISTERS["SPEED_REF"])
            except motorlink.PortError:
                await asyncio.sleep(0.01)

    async def main() -> None:
        async with aio.st.open(drive.path) as bus:
            motor = bus.motor(1)
            drive.delay = lambda: 5.0
            exchange = asyncio.ensure_future(motor.get("SPEED_REF"))
            await asyncio.sleep(0.01)
            drive.unplug()
            with pytest.raises(motorlink.LinkError, match="hung up"):
                await within(10, exchange)
            with pytest.raises(motorlink.PortError, match=str(drive.path)):
                await motor.get("SPEED_REF")
            drive.delay = lambda: 0.0
            drive.plug()
            assert await is_right(motor)
            # The loss is also detected without an exchange.
            drive.unplug()
            while bus._core.is_open:
                await asyncio.sleep(0.001)
            drive.plug()
            assert await is_right(motor)

    asyncio.run(within(60, main()))


def test_a_repeated_reply_is_not_confirmed(drive: Drive) -> None:
    async def main() -> None:
        async with aio.st.open(drive.path) as client:
            motor = client.motor(1)
            await motor.get("SPEED_REF")
            await client.confirm()
            drive.twice = True
            await motor.get("SPEED_REF")
            drive.twice = False
            with pytest.raises(motorlink.LinkError, match="trust"):
                await client.confirm()
            assert await motor.get("SPEED_REF") == value(drive.number, 1, REGISTERS["SPEED_REF"])
            await asyncio.gather(client.confirm(), motor.get("SPEED_REF"), client.confirm())

    asyncio.run(within(60, main()))


def wrong(bus: Any) -> list[Callable[[], Any]]:
    """Calls that fail, of either API."""
    motor = bus.motor(1)
    return [
        lambda: motor.get("NO_SUCH"),
        lambda: motor.set_ramp(101, 1),
        lambda: motor.revup_data(9),
        lambda: motor.set("SPEED_KP", 1),
        lambda: motor.set_position(1, 1),
        lambda: motor.start(),
        lambda: bus.raw(0x12, bytes(8)),
        lambda: bus.raw(0x20),
    ]


def test_errors_are_those_of_the_blocking_api(drive: Drive) -> None:
    def text(error: BaseException) -> str:
        return f"{type(error).__name__}: {error}"

    async def awaited() -> list[str]:
        told = []
        async with aio.st.open(drive.path, speed_limit_rpm=100) as bus:
            for call in wrong(bus):
                with pytest.raises(motorlink.MotorlinkError) as error:
                    await call()
                told.append(text(error.value))
        return told

    blocking = []
    with motorlink.st.open(drive.path, speed_limit_rpm=100) as bus:
        for call in wrong(bus):
            with pytest.raises(motorlink.MotorlinkError) as error:
                call()
            blocking.append(text(error.value))
    assert asyncio.run(awaited()) == blocking


def test_a_bus_belongs_to_one_loop() -> None:
    async def opened() -> aio.st.Client:
        return await aio.st.open("sim:")

    bus = asyncio.run(opened())
    with pytest.raises(RuntimeError, match="another event loop"):
        asyncio.run(bus.board_info())


def test_a_cancelled_open_leaves_the_port_free(drive: Drive) -> None:
    async def main() -> None:
        opening = asyncio.ensure_future(aio.st.open(drive.path)._open())
        await asyncio.sleep(0)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        while True:
            try:
                async with aio.st.open(drive.path) as bus:
                    await bus.motor(1).get("SPEED_REF")
                return
            except motorlink.PortError:
                await asyncio.sleep(0.001)

    asyncio.run(within(10, main()))


def test_a_verified_write_is_repeated_and_reports_the_value(drive: Drive) -> None:
    answers = iter([6, 7, 6, 6, 6, 0xFFFB])
    drive.reads = lambda register: next(answers)

    async def main() -> None:
        async with aio.st.open(drive.path) as bus:
            motor = bus.motor(1)
            assert await motor.set_verified("SPEED_KP", 7) == 2
            with pytest.raises(motorlink.RefusedError, match="should be 7 and reads 6"):
                await motor.set_verified("SPEED_KP", 7)
            assert await motor.set_verified("SPEED_KP", -5) == 1
            with pytest.raises(motorlink.InvalidValueError, match="cannot be verified"):
                await motor.set_verified("TORQUE_REF", 100)
        assert next(answers, None) is None

    asyncio.run(within(60, main()))


def test_a_cancelled_task_leaves_the_opening_of_a_port_to_the_others() -> None:
    goes_on = threading.Event()

    class Lost:
        """A port that takes its time to be opened."""

        is_open, port = False, "lost"

        def reopen(self) -> None:
            self.is_open = goes_on.wait(10)

        def fileno(self) -> int | None:
            return None

    async def main() -> None:
        steps = Steps(Lost(), lambda: None)
        cancelled, other = [asyncio.ensure_future(steps.ready()) for _ in range(2)]
        await asyncio.sleep(0)
        cancelled.cancel()
        await asyncio.wait([cancelled])
        goes_on.set()
        await other

    asyncio.run(within(60, main()))
