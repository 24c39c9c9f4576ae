"""`client.sample`: its columns, its instants, and its rows after an error."""

from __future__ import annotations

import asyncio
import importlib.util
from collections.abc import Callable

import numpy as np
import pytest

import motorlink
from motorlink import aio, rmd, sim, st


def test_registers_are_sampled_in_their_units(st_bus: st.Client) -> None:
    data = st_bus.sample(["SPEED_MEAS", "BUS_VOLTAGE", 0x27], rate=200, seconds=0.25)
    assert data.dtype.names == ("t", "SPEED_MEAS", "BUS_VOLTAGE", "I_Q")
    assert all(data.dtype[name] == np.float64 for name in data.dtype.names or ())
    assert set(data["BUS_VOLTAGE"]) == {st_bus.motor(1).get("BUS_VOLTAGE")}
    assert 1 <= len(data) <= 50
    data["t"][0] = 0  # The array is the caller's.


def test_motors_have_columns_in_digits_or_units() -> None:
    with st.open(sim.Bench(), full_scale_amps=32.767) as bus:
        bus.motor(1).set("TORQUE_REF", 1.5)
        bus.motor(2).set("TORQUE_REF", -1)
        asked = {1: ["TORQUE_REF", "STATUS"], 2: ["TORQUE_REF"]}
        data = bus.sample(asked, rate=50, seconds=0.3)
        assert data.dtype.names == ("t", "TORQUE_REF_1", "STATUS_1", "TORQUE_REF_2")
        assert data["TORQUE_REF_1"] == pytest.approx(1.5) and data["TORQUE_REF_2"] == pytest.approx(-1)
        data = bus.sample(asked, rate=50, seconds=0.3, raw=True)
        assert data.dtype["TORQUE_REF_2"] == np.int64
        assert set(data["TORQUE_REF_1"]) == {1500} and set(data["TORQUE_REF_2"]) == {-1000}
        data = bus.sample(["TORQUE_REF"], motor=2, rate=50, seconds=0.3, raw=True)
        assert set(data["TORQUE_REF"]) == {-1000}


def test_values_of_motors_are_sampled_in_cycles() -> None:
    bench = sim.Bench()
    bench.rmd.motor(1).set_speed(500)
    bench.run(1)
    asked = {1: ["speed_dps", "multi_turn_angle_degrees", "voltage_volts"], 2: ["speed_dps"]}
    data = bench.rmd.sample(asked, rate=100, seconds=0.5)
    names = ("t", "speed_dps_1", "multi_turn_angle_degrees_1", "voltage_volts_1", "speed_dps_2")
    assert data.dtype.names == names
    assert data["speed_dps_1"][-1] > 400 and set(data["speed_dps_2"]) == {0}
    angle = data["multi_turn_angle_degrees_1"]
    assert np.all(np.diff(angle) >= 0) and angle[-1] > angle[0]
    assert data["voltage_volts_1"] == pytest.approx(24, abs=1)
    every = bench.rmd.sample(rmd.QUANTITIES, rate=100, seconds=0.3, motor=1, raw=True)
    assert every.dtype.names == ("t", *rmd.QUANTITIES)
    assert every["voltage_volts"][0] == pytest.approx(240, abs=10)


def test_a_silent_motor_can_be_skipped() -> None:
    with rmd.open(sim.Bench(), timeout=0.2, quarantine=0.01) as bus:
        asked = {1: ["iq_amps"], 9: ["iq_amps"]}
        with pytest.raises(motorlink.ReplyTimeoutError) as silent:
            bus.sample(asked, rate=50, seconds=0.3)
        assert silent.value.motor == 9 and len(silent.value.samples) == 0
        assert len(bus.sample(asked, rate=50, seconds=0.1, on_error="skip")) == 0
        assert len(bus.sample({1: ["iq_amps"]}, rate=50, seconds=0.3)) > 0


def test_invalid_arguments_are_refused(st_bus: st.Client, rmd_bus: rmd.Client) -> None:
    cases: list[Callable[[], object]] = [
        lambda: st_bus.sample([], rate=10, seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=0, seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=float("nan"), seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=10, seconds=-1),
        lambda: st_bus.sample(["STATUS"], rate=1e9, seconds=10),
        lambda: st_bus.sample(["STATUS", "status"], rate=10, seconds=1),
        lambda: st_bus.sample({9: ["STATUS"]}, rate=10, seconds=1),
        lambda: st_bus.sample({1: "SPEED_MEAS"}, rate=10, seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=10, seconds=1, on_error="pray"),
        lambda: rmd_bus.sample({1: ["speed"]}, rate=10, seconds=1),
        lambda: rmd_bus.sample({0: ["iq_amps"]}, rate=10, seconds=1),
    ]
    for nonsense in cases:
        with pytest.raises(motorlink.InvalidValueError):
            nonsense()
    with pytest.raises(motorlink.RefusedError):
        st_bus.sample({7: ["STATUS"]}, rate=10, seconds=1)


def test_samplings_do_not_use_the_segments_of_others() -> None:
    bus = sim.Bench().st
    motor = bus.motor(1)
    motor.configure_segment(3, ["SPEED_KP", "SPEED_KI"])
    here = motor.segment(3)
    samplings = [bus.samples(names, rate=200) for names in (["SPEED_KD", "BUS_VOLTAGE"], ["TORQUE_KP", "HEATS_TEMP"])]
    for rows in samplings * 2:
        row = next(rows)
        assert all(row[name] == motor.get(name) for name in row if name != "t")
    assert bus._segments._sampled == {1, 2} and motor.segment(3) == here


def test_exchanges_of_other_tasks_run_during_a_sampling() -> None:
    async def main() -> None:
        async with aio.st.open("sim:") as bus, aio.rmd.open("sim:", timeout=30) as motors:
            names = ["SPEED_MEAS", "SPEED_REF"]
            tasks = [
                asyncio.ensure_future(bus.sample(names, rate=1000, seconds=60)),
                asyncio.ensure_future(motors.sample(rmd.QUANTITIES, rate=1000, seconds=60)),
            ]
            for value in range(20):
                await bus.motor(1).set("SPEED_KP", value)
                assert await bus.motor(1).get("SPEED_KP") == value
                assert (await motors.motor(2).status()).voltage_volts == pytest.approx(24, abs=1)
            with pytest.raises(motorlink.InvalidValueError, match="in use"):
                await bus.motor(1).configure_segment(3, names)
            for task in tasks:
                task.cancel()
            done = await asyncio.gather(*tasks, return_exceptions=True)
            assert all(isinstance(one, asyncio.CancelledError) for one in done)
            assert await bus.motor(1).get("SPEED_KP") == 19
            await bus.motor(1).configure_segment(3, names)

    asyncio.run(main())


def test_a_cancelled_sample_has_its_rows() -> None:
    async def main() -> None:
        async with aio.st.open("sim:") as bus:
            task = asyncio.ensure_future(bus.sample(["SPEED_MEAS"], rate=100, seconds=60))
            await asyncio.sleep(0.3)
            task.cancel()
            with pytest.raises(asyncio.CancelledError) as ended:
                await task
            # Before Python 3.11 the task's own exception is the context of what is raised here.
            context: BaseException | None = ended.value
            while context is not None and not hasattr(context, "samples"):
                context = context.__context__
            assert context is not None and len(context.samples) > 0

    asyncio.run(main())


def test_asyncio_skips_a_silent_motor() -> None:
    async def main() -> None:
        async with aio.rmd.open("sim:", timeout=0.2, quarantine=0.01) as bus:
            asked = {1: ["iq_amps"], 9: ["iq_amps"]}
            with pytest.raises(motorlink.ReplyTimeoutError) as silent:
                await bus.sample(asked, rate=50, seconds=0.3)
            assert silent.value.motor == 9 and len(silent.value.samples) == 0
            assert len(await bus.sample(asked, rate=50, seconds=0.1, on_error="skip")) == 0
            data = await bus.sample({1: ["voltage_volts", "multi_turn_angle_degrees"]}, rate=50, seconds=0.3)
            assert data["voltage_volts_1"] == pytest.approx(24, abs=1)

    asyncio.run(main())


def test_names_of_registers_in_asyncio() -> None:
    async def main() -> None:
        async with aio.st.open("sim:", full_scale_amps=10) as bus:
            registers = bus.motor(1).registers
            assert "SPEED_KP" in registers and "NO_SUCH" not in registers
            assert len(list(registers)) == len(registers) > 50
            assert registers.info("TORQUE_MEAS").unit == "A"
            with pytest.raises(KeyError):
                registers.info("NO_SUCH")

    asyncio.run(main())
