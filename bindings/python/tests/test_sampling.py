"""`client.sample`: its columns, its instants, and its rows after an error."""

from __future__ import annotations

import asyncio
import importlib
import importlib.util
import threading
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import motorlink
from conftest import Served, eventually
from motorlink import aio, rmd, sim, st


def test_registers_are_sampled_in_their_units(st_bus: st.Client) -> None:
    data = st_bus.sample(["SPEED_MEAS", "BUS_VOLTAGE", 0x27], rate=200, seconds=0.25)
    assert data.dtype.names == ("t", "SPEED_MEAS", "BUS_VOLTAGE", "I_Q")
    assert all(data.dtype[name] == np.float64 for name in data.dtype.names or ())
    assert set(data["BUS_VOLTAGE"]) == {st_bus.motor(1).get("BUS_VOLTAGE")}
    assert 1 <= len(data) <= 50
    data["t"][0] = 0  # The array is the caller's.


def test_instants_do_not_drift_and_no_row_is_invented(st_bus: st.Client) -> None:
    t = st_bus.sample(["SPEED_MEAS"], rate=100, seconds=0.5)["t"]
    instants = np.floor(t * 100 + 1e-6).astype(int)
    assert np.all(np.diff(instants) >= 1), "a row an instant at most"
    assert instants[0] == 0 and instants[-1] <= 49
    assert np.all(t * 100 - instants < 1)


def test_a_slow_line_skips_instants(served: Served) -> None:
    with st.open(served.st) as bus:
        data = bus.sample(["SPEED_MEAS"], rate=1_000_000, seconds=0.3)
    assert 1 <= len(data) < 300_000
    assert np.all(np.diff(data["t"]) > 0)


def test_segments_and_single_reads_have_the_same_values(tmp_path: Any) -> None:
    config = tmp_path / "bench.toml"
    config.write_text('profile = "mcsdk-5.4"\n')
    names = ["BUS_VOLTAGE", "SPEED_KP"]
    # The client uses segments, which this drive refuses.
    with st.open(f"sim:{config}") as single, st.open("sim:") as many:
        for bus in (single, many):
            bus.motor(1).set("SPEED_KP", 77)
        one, other = (bus.sample(names, rate=100, seconds=0.3) for bus in (single, many))
    assert set(one["SPEED_KP"]) == set(other["SPEED_KP"]) == {77}
    assert set(one["BUS_VOLTAGE"]) == set(other["BUS_VOLTAGE"])


def test_more_registers_than_a_segment_has(st_bus: st.Client) -> None:
    registers = st_bus.motor(1).registers
    names = [name for name in registers.get_all()][:40]
    data = st_bus.sample(names, rate=20, seconds=0.3)
    assert data.dtype.names == ("t", *names)
    assert data["SPEED_KP"][0] == registers.SPEED_KP


def test_motors_have_columns_of_their_own(st_bus: st.Client) -> None:
    st_bus.motor(1).set("SPEED_KP", 11)
    st_bus.motor(2).set("SPEED_KP", 22)
    asked = {1: ["SPEED_KP", "STATUS"], 2: ["SPEED_KP", "STATUS"]}
    data = st_bus.sample(asked, rate=50, seconds=0.3)
    assert data.dtype.names == ("t", "SPEED_KP_1", "STATUS_1", "SPEED_KP_2", "STATUS_2")
    assert set(data["SPEED_KP_1"]) == {11} and set(data["SPEED_KP_2"]) == {22}


def test_raw_samples_are_digits(st_bus: st.Client) -> None:
    st_bus.motor(1).set("TORQUE_REF", -1234)
    data = st_bus.sample(["TORQUE_REF", "FLAGS"], rate=50, seconds=0.3, raw=True)
    assert data.dtype["TORQUE_REF"] == np.int64
    assert set(data["TORQUE_REF"]) == {-1234} and set(data["FLAGS"]) == {0}


def test_currents_are_amperes_where_full_scale_is_known() -> None:
    with st.open("sim:", full_scale_amps=32.767) as bus:
        bus.motor(1).set("TORQUE_REF", 1.5)
        data = bus.sample(["TORQUE_REF"], rate=50, seconds=0.3)
    assert data["TORQUE_REF"] == pytest.approx(1.5)


def test_values_of_motors_are_sampled_in_cycles(rmd_bus: rmd.Client) -> None:
    motor = rmd_bus.motor(1)
    motor.set_speed(500)
    eventually(lambda: motor.motion_status().speed_dps > 400, "400 °/s")
    asked = {1: ["speed_dps", "multi_turn_angle_degrees", "voltage_volts"], 2: ["speed_dps"]}
    data = rmd_bus.sample(asked, rate=100, seconds=0.5)
    names = ("t", "speed_dps_1", "multi_turn_angle_degrees_1", "voltage_volts_1", "speed_dps_2")
    assert data.dtype.names == names
    assert data["speed_dps_1"][-1] > 400 and set(data["speed_dps_2"]) == {0}
    angle = data["multi_turn_angle_degrees_1"]
    assert np.all(np.diff(angle) >= 0) and angle[-1] > angle[0]
    assert data["voltage_volts_1"] == pytest.approx(24, abs=1)
    every = rmd_bus.sample(rmd.QUANTITIES, rate=100, seconds=0.3, motor=1, raw=True)
    assert every.dtype.names == ("t", *rmd.QUANTITIES)
    assert every["voltage_volts"][0] == pytest.approx(240, abs=10)


def test_quantities_are_fields_of_replies() -> None:
    fields = {*rmd.MotionStatus._fields, *rmd.Status._fields, *rmd.PhaseCurrents._fields}
    assert {*fields, "multi_turn_angle_degrees", "single_turn_angle_degrees"} <= set(rmd.QUANTITIES)


def test_an_error_has_the_rows_before_it(served: Served) -> None:
    with st.open(served.st, timeout=0.05, on_close="nothing") as bus:
        bus.motor(1).get("STATUS")
        cut = threading.Timer(0.2, served.end)
        cut.start()
        with pytest.raises(motorlink.MotorlinkError) as ended:
            bus.sample(["SPEED_MEAS", "STATUS"], rate=100, seconds=20)
        cut.join()
    assert isinstance(ended.value, (motorlink.LinkError, motorlink.ReplyTimeoutError))
    assert len(ended.value.samples) > 0
    assert ended.value.samples.dtype.names == ("t", "SPEED_MEAS", "STATUS")


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
        lambda: st_bus.sample(["STATUS"], rate=-1, seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=float("nan"), seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=10, seconds=-1),
        lambda: st_bus.sample(["STATUS"], rate=1e9, seconds=10),
        lambda: st_bus.sample(["STATUS", "status"], rate=10, seconds=1),
        lambda: st_bus.sample(["STATE"], rate=10, seconds=1),
        lambda: st_bus.sample({9: ["STATUS"]}, rate=10, seconds=1),
        lambda: st_bus.sample(["STATUS"], rate=10, seconds=1, on_error="pray"),
        lambda: rmd_bus.sample({1: ["speed"]}, rate=10, seconds=1),
        lambda: rmd_bus.sample({0: ["iq_amps"]}, rate=10, seconds=1),
    ]
    for nonsense in cases:
        with pytest.raises(motorlink.InvalidValueError):
            nonsense()
    with pytest.raises(motorlink.RefusedError):
        st_bus.sample({7: ["STATUS"]}, rate=10, seconds=1)


def test_without_pandas_the_error_names_the_package(st_bus: st.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    data = st_bus.sample(["STATUS"], rate=100, seconds=0.3)
    plain = importlib.import_module

    def missing(name: str, package: str | None = None) -> Any:
        if name == "pandas":
            raise ModuleNotFoundError("No module named 'pandas'", name="pandas")
        return plain(name, package)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(ImportError, match="pip install pandas"):
        motorlink.to_pandas(data)


class Frame:
    """The part of pandas that `to_pandas` uses."""

    def __init__(self, columns: dict[str, Any]):
        self.columns, self.index = columns, ""

    def set_index(self, name: str) -> Frame:
        """Remembers the index."""
        self.index = name
        return self


def test_with_pandas_the_time_is_the_index(
    st_bus: st.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = st_bus.sample(["STATUS", "SPEED_MEAS"], rate=100, seconds=0.3)
    if importlib.util.find_spec("pandas"):
        frame = motorlink.to_pandas(data)
        assert list(frame.columns) == ["STATUS", "SPEED_MEAS"] and frame.index.name == "t"
        return
    pandas = types.SimpleNamespace(DataFrame=Frame)
    monkeypatch.setattr(importlib, "import_module", lambda name: pandas)
    frame = motorlink.to_pandas(data)
    assert list(frame.columns) == ["t", "STATUS", "SPEED_MEAS"] and frame.index == "t"


def test_samplings_do_not_use_the_segments_of_others(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    motor.configure_segment(3, ["SPEED_KP", "SPEED_KI"])
    here = motor.segment(3)
    sampled: list[bool] = []

    def look(names: list[str]) -> None:
        data = st_bus.sample(names, rate=200, seconds=0.3)
        sampled.append(all(set(data[name]) == {motor.get(name)} for name in names))

    others = [["SPEED_MEAS", "SPEED_REF"], ["BUS_VOLTAGE", "HEATS_TEMP"]]
    threads = [threading.Thread(target=look, args=[names]) for names in others]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sampled == [True, True]
    assert motor.segment(3) == here


def test_asyncio_samples_what_the_blocking_api_samples(served: Served) -> None:
    asked = {1: ["SPEED_KP", "BUS_VOLTAGE"], 2: ["SPEED_KP"]}
    with st.open(served.st) as bus:
        bus.motor(1).set("SPEED_KP", 11)
        bus.motor(2).set("SPEED_KP", 22)
        plain = bus.sample(asked, rate=50, seconds=0.2, raw=True)

    async def main() -> None:
        async with aio.st.open(served.st) as bus:
            data = await bus.sample(asked, rate=50, seconds=0.2, raw=True)
            assert data.dtype == plain.dtype and len(data) > 0
            assert all(set(data[name]) == set(plain[name]) for name in plain.dtype.names or () if name != "t")
            assert bus._segments._sampled == set()
            t = (await bus.sample(["STATUS"], rate=100, seconds=0.3))["t"]
            instants = np.floor(t * 100 + 1e-6).astype(int)
            assert np.all(np.diff(instants) >= 1) and instants[-1] <= 29

    asyncio.run(main())


def test_asyncio_samples_without_segments_where_the_drive_has_none(tmp_path: Any) -> None:
    config = tmp_path / "bench.toml"
    config.write_text('profile = "mcsdk-5.4"\n')

    async def main() -> None:
        # The client uses segments, which this drive refuses.
        async with aio.st.open(f"sim:{config}") as bus:
            await bus.motor(1).set("SPEED_KP", 77)
            data = await bus.sample(["BUS_VOLTAGE", "SPEED_KP"], rate=100, seconds=0.2)
            assert set(data["SPEED_KP"]) == {77}

    asyncio.run(main())


def test_exchanges_of_other_tasks_run_during_a_sampling() -> None:
    async def main() -> None:
        async with aio.st.open("sim:") as bus, aio.rmd.open("sim:", timeout=30) as motors:
            names = ["SPEED_MEAS", "SPEED_REF"]
            tasks = [
                asyncio.ensure_future(bus.sample(names, rate=1000, seconds=60)),
                asyncio.ensure_future(bus.sample(["SPEED_KP", "SPEED_KI"], rate=1000, seconds=60)),
                asyncio.ensure_future(motors.sample(rmd.QUANTITIES, rate=1000, seconds=60)),
            ]
            for value in range(50):
                await bus.motor(1).set("SPEED_KP", value)
                assert await bus.motor(1).get("SPEED_KP") == value
                assert (await motors.motor(2).status()).voltage_volts == pytest.approx(24, abs=1)
            with pytest.raises(motorlink.InvalidValueError, match="in use"):
                await bus.motor(1).configure_segment(3, names)
            for task in tasks:
                task.cancel()
            done = await asyncio.gather(*tasks, return_exceptions=True)
            assert all(isinstance(one, asyncio.CancelledError) for one in done)
            assert await bus.motor(1).get("SPEED_KP") == 49
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


def test_asyncio_refuses_invalid_arguments() -> None:
    async def main() -> None:
        async with aio.st.open("sim:") as bus:
            for names, rate in (([], 10), (["STATUS"], 0), (["STATUS", "status"], 10), (["STATE"], 10)):
                with pytest.raises(motorlink.InvalidValueError):
                    await bus.sample(names, rate=rate, seconds=1)
            with pytest.raises(motorlink.RefusedError):
                await bus.sample({7: ["STATUS"]}, rate=10, seconds=1)

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


def test_one_name_is_not_taken_for_a_list(st_bus: st.Client) -> None:
    with pytest.raises(motorlink.InvalidValueError, match="list of names"):
        st_bus.sample("SPEED_MEAS", rate=10, seconds=0.1)
    with pytest.raises(motorlink.InvalidValueError, match="'SPEED_MEAS' is one name"):
        st_bus.sample({1: "SPEED_MEAS"}, rate=10, seconds=0.1)
