"""Sampling on a bad line, while other threads and tasks use the client, and around a lost port."""

from __future__ import annotations

import asyncio
import functools
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorlink
from conftest import PATIENT, eventually
from drive import EXECUTE, GET_REG, REGISTERS, START, STOP, Drive, value
from motorlink import aio, rmd, sim, st

#: Firmware that refuses data segments is read register by register.
NAMES = list(REGISTERS)


@pytest.fixture
def drive(tmp_path: Path) -> Iterator[Drive]:
    """A drive whose values say which register they belong to."""
    drive = Drive(tmp_path / "st0", 1)
    yield drive
    drive.unplug()


def is_right(row: motorlink.Sample) -> bool:
    """Whether each value is that of its register."""
    return all(row[name] == value(1, 1, register) for name, register in REGISTERS.items())


def requests(heard: bytes) -> list[tuple[int, int]]:
    """The frame codes and first bytes of the requests that a drive has received."""
    found = []
    while len(heard) >= 3 and len(heard) >= heard[1] + 3:
        found.append((heard[0] & 0x1F, heard[2]))
        heard = heard[heard[1] + 3 :]
    return found


def has_heard(drive: Drive, count: int) -> bool:
    """Whether a drive has received so many bytes."""
    return len(drive.heard) >= count


def test_replies_that_come_twice_give_no_wrong_value(drive: Drive) -> None:
    with st.open(str(drive.path), timeout=0.2, on_close="nothing") as client:
        rows = client.samples(NAMES, rate=100, on_error="skip", raw=True)
        assert is_right(next(rows))
        drive.twice = True
        # The last reply before it could come twice, too: the second one belongs to the next request.
        again = threading.Timer(0.4, setattr, [drive, "twice", False])
        again.start()
        for row in rows:
            assert is_right(row)
            if row.t > 1:
                break
        again.join()


def test_asyncio_gives_no_wrong_value_of_replies_that_come_twice(drive: Drive) -> None:
    async def main() -> None:
        async with aio.st.open(str(drive.path), timeout=0.2, on_close="nothing") as client:
            rows = client.samples(NAMES, rate=100, raw=True)
            assert is_right(await rows.__anext__())
            drive.twice = True
            with pytest.raises(motorlink.LinkError):
                async for row in rows:
                    assert is_right(row)

    asyncio.run(main())


def test_a_bad_bus_gives_no_wrong_value() -> None:
    bench = sim.Bench()
    port = bench.port(fault="dup=0.02,drop=0.02,seed=5")
    with rmd.open(port, timeout=0.02, quarantine=0.01) as client:
        asked = {1: ["voltage_volts", "encoder"], 2: ["multi_turn_angle_degrees", "voltage_volts"]}
        data = client.sample(asked, rate=100, seconds=3, on_error="skip")
    assert len(data) > 20
    assert set(data["voltage_volts_1"]) == set(data["voltage_volts_2"]) == {24}
    assert set(data["multi_turn_angle_degrees_2"]) == {0}


def test_a_stop_of_another_thread_goes_ahead_of_all_but_one_exchange(drive: Drive) -> None:
    drive.delay = lambda: 0.002
    with st.open(str(drive.path), timeout=PATIENT, on_close="nothing") as client:
        motor = client.motor(1)
        motor.execute("START_MOTOR")
        assert drive.executed == [(1, START)]
        ended = threading.Event()

        def sample() -> None:
            # The rate is too high for the line, so exchanges follow each other without a pause.
            with pytest.raises(motorlink.ClosedError):
                client.sample(NAMES, rate=10_000, seconds=600)
            ended.set()

        thread = threading.Thread(target=sample)
        thread.start()
        for _ in range(5):
            seen = len(drive.heard) + 50
            eventually(functools.partial(has_heard, drive, seen), "exchanges")
            before = len(requests(drive.heard))
            motor.execute("STOP_MOTOR")
            # One may begin before this thread asks for its turn.
            assert requests(drive.heard)[before:].index((EXECUTE, STOP)) <= 2
        client.close()
        thread.join(60)
    assert ended.is_set()
    assert GET_REG in {code for code, _ in requests(drive.heard)}


def test_a_stop_of_another_task_goes_ahead_of_all_but_one_exchange(drive: Drive) -> None:
    drive.delay = lambda: 0.002

    async def main() -> None:
        async with aio.st.open(str(drive.path), timeout=PATIENT, on_close="nothing") as client:
            motor = client.motor(1)
            sampling = asyncio.ensure_future(client.sample(NAMES, rate=10_000, seconds=600))
            for _ in range(5):
                seen = len(drive.heard)
                while len(drive.heard) < seen + 50:
                    await asyncio.sleep(0.001)
                before = len(requests(drive.heard))
                await motor.execute("STOP_MOTOR")
                assert requests(drive.heard)[before:].index((EXECUTE, STOP)) <= 2
            sampling.cancel()
            with pytest.raises(asyncio.CancelledError):
                await sampling

    asyncio.run(main())


def test_a_stop_waits_for_no_motor_in_quarantine_that_is_sampled() -> None:
    with rmd.open("sim:", timeout=1, quarantine=30) as client:
        motor = client.motor(1)
        motor.set_speed(300)
        ended = threading.Event()

        def sample() -> None:
            with pytest.raises(motorlink.ClosedError):
                for _ in client.samples({1: ["speed_dps"], 9: ["speed_dps"]}, rate=100, on_error="skip"):
                    pass
            ended.set()

        thread = threading.Thread(target=sample)
        thread.start()
        began = time.monotonic()
        # A stop may come before the first question to motor 9 has failed, so there are some.
        while time.monotonic() < began + 2:
            before = time.monotonic()
            motor.stop()
            assert time.monotonic() < before + 15
        client.close()
        thread.join(60)
    assert ended.is_set()


def test_rows_go_on_after_a_port_that_was_lost(drive: Drive) -> None:
    with st.open(str(drive.path), timeout=0.2, on_close="nothing") as client:
        rows = client.samples(NAMES, rate=50, on_error="skip", raw=True)
        assert is_right(next(rows))
        drive.unplug()
        back = threading.Timer(0.2, drive.plug)
        back.start()
        # Rows that were read before the end may come first.
        row = next(row for row in rows if row.t > 0.25)
        assert is_right(row)
        assert is_right(next(rows))
        back.join()


def test_asyncio_rows_go_on_after_a_port_that_was_lost(drive: Drive) -> None:
    async def main() -> None:
        async with aio.st.open(str(drive.path), timeout=0.2, on_close="nothing") as client:
            rows = client.samples(NAMES, rate=50, on_error="skip", raw=True)
            assert is_right(await rows.__anext__())
            drive.unplug()
            back = threading.Timer(0.2, drive.plug)
            back.start()
            async for row in rows:
                assert is_right(row)
                if row.t > 0.25:
                    break
            back.join()

    asyncio.run(main())


def test_a_failure_of_another_thread_ends_no_sampling(drive: Drive) -> None:
    with st.open(str(drive.path), timeout=0.5, on_close="nothing") as client:
        drive.is_deaf_to = 0x20
        rows = client.samples(NAMES, rate=50, raw=True)
        assert is_right(next(rows))
        for _ in range(2):
            with pytest.raises((motorlink.ReplyTimeoutError, motorlink.LinkError)):
                client.motor(1).get(0x20)
            assert is_right(next(rows))
