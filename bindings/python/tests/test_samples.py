"""`client.samples`: rows while a program runs."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

import motorlink
from conftest import PATIENT, Served, eventually
from motorlink import aio, rmd, sim, st

PAIR = ["SPEED_MEAS", "BUS_VOLTAGE"]


def segments_in_use(client: st.Client | aio.st.Client) -> set[int]:
    """The data segments that samplings of a client have claimed."""
    return client._segments._sampled


def test_rows_have_the_time_and_the_values_by_name() -> None:
    bench = sim.Bench()
    rows = list(bench.st.samples({1: PAIR, 2: ["SPEED_MEAS"]}, rate=100, seconds=0.05))
    assert [list(row) for row in rows] == [["t", "SPEED_MEAS_1", "BUS_VOLTAGE_1", "SPEED_MEAS_2"]] * 5
    assert [row.t for row in rows] == pytest.approx([0, 0.01, 0.02, 0.03, 0.04], abs=1e-4)
    assert [row.skipped for row in rows] == [0] * 5
    assert {row["BUS_VOLTAGE_1"] for row in rows} == {325.0}
    status = next(bench.rmd.samples(["voltage_volts", "speed_dps"], rate=100, motor=2))
    assert status == {"t": 0.0, "voltage_volts": 24.0, "speed_dps": 0.0}


def test_rows_and_the_array_are_the_same() -> None:
    one, other = sim.Bench(seed=3), sim.Bench(seed=3)
    rows = list(one.rmd.samples(rmd.QUANTITIES, rate=50, seconds=0.2, raw=True))
    data = other.rmd.sample(rmd.QUANTITIES, rate=50, seconds=0.2, raw=True)
    assert [tuple(row.values()) for row in rows] == data.tolist()
    assert data.dtype.names == tuple(rows[0])
    assert isinstance(rows[0]["voltage_volts"], int)


def test_a_slow_loop_gets_new_values_and_the_number_of_skipped_instants() -> None:
    bench = sim.Bench()
    times, skipped = [], []
    for row in bench.st.samples(PAIR, rate=100):
        times.append(row.t)
        skipped.append(row.skipped)
        if len(times) == 3:
            break
        bench.run(0.035)
    # Rows belong to instants 0, 3 and 7: a row is read late rather than an instant moved.
    assert skipped == [0, 2, 3]
    assert times == pytest.approx([0, 0.0375, 0.075], abs=1e-3)


def test_a_loop_that_is_a_little_too_slow_gets_values_that_are_new() -> None:
    bench = sim.Bench()
    ages = []
    began = None
    for row in bench.st.samples(["SPEED_MEAS"], rate=400, seconds=1):
        began = bench.now if began is None else began
        ages.append(bench.now - began - row.t)
        bench.run(0.009)
    assert max(ages) < 0.03


def test_break_releases_the_segments_and_leaves_the_motor_running(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    motor.start()
    for _ in st_bus.samples(PAIR, rate=100):
        assert segments_in_use(st_bus) == {3}
        break
    assert segments_in_use(st_bus) == set()
    assert st_bus.moving == [1]
    motor.configure_segment(3, PAIR)


def test_rows_keep_their_client_open() -> None:
    rows = rmd.open("sim:").samples(["voltage_volts"], rate=100, seconds=0.05)
    assert next(rows)["voltage_volts"] == pytest.approx(24, abs=1)


def test_close_ends_the_rows(st_bus: st.Client) -> None:
    rows = st_bus.samples(PAIR, rate=1000)
    next(rows)
    rows.close()
    assert segments_in_use(st_bus) == set()
    assert list(rows) == []
    rows.close()
    with contextlib.closing(st_bus.samples(PAIR, rate=1000)) as rows:
        next(rows)
    assert next(rows, None) is None


def test_a_lost_line_raises_after_the_rows_that_were_read(served: Served) -> None:
    rows = []
    with st.open(served.st, timeout=0.2, on_close="nothing") as client:
        sampling = client.samples(PAIR, rate=100)
        with pytest.raises((motorlink.LinkError, motorlink.ReplyTimeoutError)) as lost:
            for row in sampling:
                rows.append(row)
                if len(rows) == 5:
                    served.end()
        assert len(rows) >= 5 and len(lost.value.samples) == 0
        assert next(sampling, None) is None
        assert segments_in_use(client) == set()


def test_failed_rows_are_skipped_where_the_program_says_so() -> None:
    bench = sim.Bench()
    with rmd.open(bench.port(fault="drop=0.05,seed=7"), timeout=0.02, quarantine=0.01) as client:
        rows = list(client.samples(["speed_dps"], rate=100, seconds=2, on_error="skip"))
    assert 80 < len(rows) < 200
    instants = [int(row.t * 100 + 1e-3) for row in rows]
    assert instants[-1] + 1 - len(rows) == sum(row.skipped for row in rows) > 0


def test_wrong_arguments_are_refused_before_the_first_row(st_bus: st.Client) -> None:
    cases: list[Callable[[], object]] = [
        lambda: st_bus.samples("SPEED_MEAS", rate=10),
        lambda: st_bus.samples(["STATE"], rate=10),
        lambda: st_bus.samples(PAIR, rate=10, on_error="ignore"),
    ]
    for case in cases:
        with pytest.raises(motorlink.InvalidValueError):
            case()
    assert segments_in_use(st_bus) == set()


def test_one_row_at_a_time(st_bus: st.Client) -> None:
    """Two threads that ask one sampling for rows would mix them."""
    rows = st_bus.samples(PAIR, rate=0.01)
    next(rows)
    ended: list[Exception] = []

    def wait() -> None:
        try:
            next(rows)
        except motorlink.ClosedError as error:
            ended.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    eventually(rows._turn.locked, "a thread that waits for a row")
    with pytest.raises(RuntimeError, match="in use by another thread, task or signal handler"):
        next(rows)
    st_bus.close()
    thread.join(60)
    assert ended


LOOP = """\
import sys, motorlink
with motorlink.{protocol}.open(sys.argv[1], timeout=2) as client:
    client.motor(1).{start}
    for row in client.samples({names}, rate=50):
        print(row, flush=True)
"""


@pytest.mark.parametrize(("protocol", "number"), [("st", signal.SIGINT), ("rmd", signal.SIGTERM)])
def test_signals_end_the_loop_and_stop_the_motor(
    served: Served, protocol: str, number: signal.Signals
) -> None:
    start, names = ("start()", PAIR) if protocol == "st" else ("set_speed(300)", ["speed_dps"])
    port = served.st if protocol == "st" else served.can
    text = LOOP.format(protocol=protocol, start=start, names=names)
    program = subprocess.Popen(
        [sys.executable, "-c", text, port], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert program.stdout is not None
    for _ in range(3):
        assert program.stdout.readline().startswith("{'t': ")
    program.send_signal(number)
    _, errors = program.communicate(timeout=60)
    assert program.returncode == -number
    assert ("KeyboardInterrupt" in errors) == (number == signal.SIGINT)
    if protocol == "st":
        at_rest = ("STOP", "STOP_IDLE", "IDLE")
        eventually(lambda: served.motor("st", 1)["status"] in at_rest, "a stop")
    else:
        eventually(lambda: served.motor("rmd", 1)["speed_dps"] == 0, "a stop", within=20)


def test_async_rows_are_the_blocking_rows(served: Served) -> None:
    asked = {1: ["SPEED_KP", "BUS_VOLTAGE"], 2: ["SPEED_KP"]}
    with st.open(served.st) as plain:
        row = next(plain.samples(asked, rate=50, raw=True))

    async def main() -> None:
        async with aio.st.open(served.st) as client:
            rows = [one async for one in client.samples(asked, rate=50, seconds=0.2, raw=True)]
            assert 1 <= len(rows) <= 10
            assert all({**one, "t": 0.0} == row for one in rows)
            assert segments_in_use(client) == set()
            async for _ in client.samples(PAIR, rate=50):
                assert segments_in_use(client) == {3}
                break
            assert segments_in_use(client) == set()
        async with aio.rmd.open(served.can, timeout=PATIENT) as bus:
            async for one in bus.samples(["voltage_volts"], rate=50, seconds=0.1):
                assert one["voltage_volts"] == 24

    asyncio.run(main())


def test_a_slow_task_gets_the_number_of_skipped_instants() -> None:
    async def main() -> None:
        async with aio.st.open("sim:") as client:
            rows = []
            async for row in client.samples(PAIR, rate=1000):
                rows.append(row)
                if len(rows) == 5:
                    break
                await asyncio.sleep(0.05)
            assert all(row.skipped >= 48 for row in rows[1:])
            # No row is read before its instant.
            assert rows[-1].t * 1000 + 1e-3 >= sum(row.skipped + 1 for row in rows) - 1

    asyncio.run(main())
