"""The blocking API for ST drives, on simulated ones."""

from __future__ import annotations

import asyncio
import copy
import pickle
from pathlib import Path

import pytest

import motorlink
from conftest import PATIENT, Served, eventually
from drive import Drive
from motorlink import aio, sim, st


def test_a_written_value_is_read(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    motor.set("SPEED_KP", 1234)
    assert motor.get("SPEED_KP") == 1234
    assert motor.get(0x05) == 1234
    assert motor.get("speed_kp", raw=True) == 1234
    assert st_bus.motor(2).get("SPEED_KP") != 1234
    motor.set("CONTROL_MODE", "TORQUE")
    motor.set("SPEED_KI", "0x10")
    assert motor.get("SPEED_KI") == 16


def test_a_motor_runs_and_stops(st_bus: st.Client) -> None:
    motor = st_bus.motor(2)
    assert motor.status() == "IDLE" and not motor.flags()
    motor.set_ramp(500, 0.1)
    motor.start()
    assert st_bus.moving == [2]
    eventually(lambda: motor.status() == "RUN", "RUN")
    assert motor.control_mode() == "SPEED"
    motor.stop()
    assert st_bus.moving == []
    eventually(lambda: motor.status() == "IDLE", "IDLE")


def test_words_keep_their_numbers_when_pickled(st_bus: st.Client) -> None:
    state = st_bus.motor(1).status()
    assert isinstance(state, st.Status) and isinstance(state, str)
    assert (str(state), state.number) == ("IDLE", 0)
    assert state.doc
    again = pickle.loads(pickle.dumps(state))
    assert (again, again.number, again.doc) == (state, state.number, state.doc)
    assert repr(state) == "Status('IDLE')"


def test_faults_are_named() -> None:
    bench = sim.Bench()
    motor = bench.st.motor(1)
    bench.inject("st1", "OVER_TEMP", hold=True)
    bench.run(0.1)
    faults = motor.flags()
    assert faults.present == ("OVER_TEMP",) == faults.occurred
    assert str(faults) == "OVER_TEMP (present)"
    assert motor.status() == "FAULT_NOW"
    with pytest.raises(motorlink.RefusedError, match=r"motor 1 did not start: .*heatsink too hot") as refused:
        motor.start()
    assert (refused.value.motor, refused.value.code) == (1, None)
    bench.inject("st1", "OVER_TEMP", hold=False)
    bench.run(0.1)
    assert not motor.flags().present
    motor.fault_ack()
    bench.run(0.1)
    assert not motor.flags()


def test_registers_are_a_mapping_with_names_and_units(st_bus: st.Client) -> None:
    registers = st_bus.motor(1).registers
    registers["SPEED_KP"] = 700
    assert registers["SPEED_KP"] == registers.SPEED_KP == 700
    registers.SPEED_KP = 701
    assert registers["SPEED_KP"] == 701
    assert "SPEED_KP" in registers and "SPEED_KP" in list(registers)
    assert "SPEED_KP" in dir(registers)
    assert "SPEED_KP" in registers._ipython_key_completions_()
    assert len(registers) == len(list(registers)) > 80
    info = registers.info("SPEED_MEAS")
    assert (info.id, info.unit, info.type, info.access) == (0x1E, "rpm", "i32", "R")
    assert info.readable and not info.writable and info.doc == "Mechanical speed, averaged"
    values = registers.get_all()
    assert values["SPEED_KP"] == 701 and "I_A" not in values
    with pytest.raises(AttributeError):
        _ = registers.SPEED_MES
    with pytest.raises(AttributeError):
        registers.SPEED_MES = 3
    with pytest.raises(motorlink.errors.UnknownRegisterError, match="^there is no register `SPEED_MES`; did"):
        _ = registers["SPEED_MES"]
    assert registers.get("SPEED_MES") is None and "SPEED_MES" not in registers
    assert registers.get("SPEED_KP") == 701
    assert issubclass(motorlink.errors.UnknownRegisterError, (motorlink.InvalidValueError, KeyError))
    with pytest.raises(KeyError):
        registers.info(0xC0)
    assert copy.copy(registers)["SPEED_KP"] == 701


def test_currents_are_amperes_where_full_scale_is_known(st_bus: st.Client) -> None:
    digits, amps = st_bus.motor(1), st_bus.motor(1, full_scale_amps=32.767)
    assert digits.registers.info("TORQUE_REF").unit == "s16A"
    assert amps.registers.info("TORQUE_REF").unit == "A"
    digits.set("TORQUE_REF", 1500)
    assert amps.get("TORQUE_REF") == pytest.approx(1.5)
    assert amps.get("TORQUE_REF", raw=True) == 1500
    amps.set("TORQUE_REF", -2.0004)
    assert digits.get("TORQUE_REF") == -2000
    amps.set_revup_data(1, 800, 3.0, 0.5)
    assert digits.revup_data(1) == (800, 3000, 0.5)
    assert amps.revup_data(1).torque == pytest.approx(3.0)
    amps.set_current_reference(0.5, -0.25)
    assert (digits.get("TORQUE_REF"), digits.get("FLUX_REF")) == (500, -250)
    with pytest.raises(motorlink.InvalidValueError, match="33 A does not fit"):
        amps.set("TORQUE_REF", 33)
    for nonsense in (0, -1, float("nan")):
        with pytest.raises(motorlink.InvalidValueError, match="full scale"):
            st_bus.motor(1, full_scale_amps=nonsense).get("TORQUE_REF")


def test_a_refusal_names_motor_and_reason(st_bus: st.Client) -> None:
    with pytest.raises(motorlink.RefusedError) as refused:
        st_bus.motor(1).get("I_A")
    error = refused.value
    assert (error.code, error.name, error.motor) == (3, "GET_WRITE_ONLY", 1)
    assert error.port and error.port.startswith("sim")
    assert "refused reading I_A" in str(error)
    assert isinstance(error, motorlink.MotorlinkError)
    with pytest.raises(motorlink.RefusedError) as refused:
        st_bus.motor(7).get("STATUS")
    assert refused.value.name == "BAD_MOTOR_SELECTED"
    with pytest.raises(motorlink.RefusedError):
        st_bus.motor(1).set("SPEED_MEAS", 3)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.code, again.port) == (str(error), error.code, error.port)


def test_a_value_that_does_not_fit_is_not_sent(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    before = motor.get("SPEED_KP")
    for value in (40000, 0.5, float("nan"), "fast", ""):
        with pytest.raises(motorlink.InvalidValueError) as bad:
            motor.set("SPEED_KP", value)
        assert isinstance(bad.value, ValueError)
    assert motor.get("SPEED_KP") == before


def test_invalid_values_are_refused_before_they_are_sent(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    for nonsense in (
        lambda: motor.set_ramp(1e12, 1),
        lambda: motor.set_ramp(196_603, 1),
        lambda: motor.set_ramp(100, -1),
        lambda: motor.set_ramp(float("nan"), 1),
        lambda: motor.revup_data(5),
        lambda: motor.set_current_reference(1e6, 0),
        lambda: motor.execute("START_ENGINE"),
        lambda: motor.execute(256),
        lambda: motor.configure_segment(4, ["STATUS"]),
        lambda: motor.segment(0),
        lambda: motor.set_position(1, 1),
        lambda: motor.set_torque_ramp(1, 1),
        lambda: st_bus.motor(8),
        lambda: st_bus.motor(-1),
        lambda: st_bus.motor(10**30),
        lambda: motor.get(256),
        lambda: st_bus.raw(0x20),
        lambda: st_bus.raw(1, bytes(129)),
        lambda: st.open("sim:", profile="5.4"),
        lambda: st.open("sim:", timeout=0),
        lambda: st.open("sim:", on_close="explode"),
        lambda: st.open("sim:", recovery="hope"),
        lambda: st.open("sim:", speed_limit_rpm=-1),
        lambda: st.open("slcan:/dev/ttyACM0"),
        lambda: st.open(""),
    ):
        with pytest.raises((motorlink.InvalidValueError, OverflowError)):
            nonsense()
    with pytest.raises(TypeError):
        motor.set_ramp("fast", 1)  # type: ignore[arg-type]
    with pytest.raises(motorlink.InvalidValueError, match="give 1 for a drive with one motor"):
        st_bus.motor(0)


def test_a_missing_port_is_named(tmp_path: Path) -> None:
    with pytest.raises(motorlink.PortError, match="is it plugged in") as error:
        st.open(tmp_path / "nothing")
    assert isinstance(error.value, motorlink.LinkError)


def test_limits_hold() -> None:
    with st.open("sim:", speed_limit_rpm=1000, current_limit=1.0, full_scale_amps=32.767) as bus:
        motor = bus.motor(1)
        with pytest.raises(motorlink.InvalidValueError, match="needs a speed ramp within the limit") as error:
            motor.start()
        assert error.value.motor == 1 and bus.moving == []
        # A current equal to the limit is rounded towards 0 as the limit is.
        motor.set_current_reference(1.0, -1.0)
        for beyond in (
            lambda: motor.set_ramp(1001, 0),
            lambda: motor.set("RAMP_FINAL_SPEED", -1001),
            lambda: motor.set_current_reference(1.002, 0),
            lambda: motor.set_revup_data(0, 1001, 0, 0.1),
            lambda: bus.raw(0x07, bytes.fromhex("e90300000000"), motor=1),
        ):
            with pytest.raises(motorlink.InvalidValueError, match="limit"):
                beyond()
        motor.set_ramp(-1000, 0)
        motor.start()


def test_a_write_is_verified(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    assert motor.set_verified("SPEED_KP", 321) == 1
    assert motor.get("SPEED_KP") == 321
    with pytest.raises(motorlink.InvalidValueError, match="cannot be verified"):
        motor.set_verified("TORQUE_REF", 100)


def test_data_segments_read_many_registers_at_once(st_bus: st.Client) -> None:
    motor = st_bus.motor(1)
    motor.configure_segment(1, ["STATUS", "BUS_VOLTAGE", "I_Q"])
    values = motor.segment(1)
    assert list(values) == ["STATUS", "BUS_VOLTAGE", "I_Q"]
    assert values["BUS_VOLTAGE"] == motor.get("BUS_VOLTAGE")
    assert motor.segment(1, [2, 0x19, 0x27]) == values


def test_the_other_profile_has_moves_and_no_segments() -> None:
    # This firmware reads the request for a segment as a torque ramp.
    bench = sim.Bench('profile = "mcsdk-5.4"')
    with st.open(bench) as bus:
        motor = bus.motor(1)
        with pytest.raises(motorlink.InvalidValueError, match="are unknown"):
            motor.segment(0)
        with pytest.raises(motorlink.RefusedError):
            motor.configure_segment(0, ["STATUS"])
        with pytest.raises(motorlink.InvalidValueError, match="not configured"):
            motor.segment(0, ["STATUS"])
        assert motor.control_mode() == "SPEED"
    with st.open(bench, profile="mcsdk-5.4") as bus:
        motor = bus.motor(1)
        motor.set_torque_ramp(100, 0.1)
        with pytest.raises(motorlink.InvalidValueError, match="profile spec"):
            motor.configure_segment(0, ["STATUS"])
        assert "CURRENT_POSITION" in motor.registers


def test_raw_frames(st_bus: st.Client) -> None:
    speed = st_bus.raw(0x02, b"\x1e", motor=1)
    assert int.from_bytes(speed, "little", signed=True) == st_bus.motor(1).get("SPEED_MEAS")
    info = st_bus.board_info()
    assert bytes(info.version) == st_bus.raw(0x06)[:3]
    assert st_bus.firmware_version().version.startswith("Ver.")


def test_a_closed_client_raises() -> None:
    bus = st.open("sim:")
    motor = bus.motor(1)
    bus.close()
    bus.close()
    for use in (lambda: motor.get("STATUS"), motor.start, bus.board_info, lambda: bus.moving):
        with pytest.raises(motorlink.ClosedError, match="was closed by this program"):
            use()
    assert "closed" in repr(bus)


def test_objects_have_a_repr(st_bus: st.Client) -> None:
    assert repr(st_bus) == "<motorlink.st.Client sim:, profile spec>"
    assert repr(st_bus.motor(2)) == "<motorlink.st.Motor 2 on sim:>"
    assert "registers of <motorlink.st.Motor 2" in repr(st_bus.motor(2).registers)
    assert "GET_REG" in repr(st.Request.get_register("STATUS"))


def test_the_end_of_with_stops_started_motors() -> None:
    bench = sim.Bench()

    def status() -> str:
        bench.run(1)
        return str(bench.truth("st1")["status"])

    with pytest.raises(ZeroDivisionError), st.open(bench) as bus:
        bus.motor(1).set_ramp(1500, 0.1)
        bus.motor(1).start()
        assert status() == "RUN"
        _ = 1 / 0
    assert status() == "IDLE"
    with st.open(bench, on_close="nothing") as bus:
        bus.motor(1).start()
    assert status() == "RUN"


def test_a_motor_that_cannot_be_stopped_raises() -> None:
    bus = st.open(sim.Bench().port(fault="drop=1,only=received"))
    with pytest.raises(motorlink.ReplyTimeoutError):
        bus.motor(1).start()
    with pytest.raises(motorlink.LinkError, match="motor 1 may still be running") as lost:
        bus.close()
    assert lost.value.motor == 1
    assert "closed" in repr(bus)


def test_a_drive_that_stops_replying_is_a_timeout_and_then_a_lost_line(tmp_path: Path) -> None:
    drive = Drive(tmp_path / "st0", 3)
    try:
        with st.open(str(drive.path), timeout=0.3) as bus:
            bus.motor(3).get("SPEED_MEAS")
            drive.answers = 0
            with pytest.raises(motorlink.ReplyTimeoutError) as silent:
                bus.motor(3).get("SPEED_MEAS")
            assert (silent.value.motor, silent.value.port) == (3, bus.port)
            assert isinstance(silent.value, TimeoutError)
            with pytest.raises(motorlink.LinkError):
                bus.motor(3).get("SPEED_MEAS")
    finally:
        drive.unplug()


def test_a_scan_has_a_result_for_each_rate(served: Served, tmp_path: Path) -> None:
    found = st.scan(served.st, [115200, 9600], timeout=PATIENT)
    assert [(one.baud, one.kind) for one in found] == [(115200, "drive")]
    assert found[0].board_info is not None and "ST MC SDK" in found[0].board_info.name
    assert asyncio.run(aio.st.scan(served.st, [115200, 9600], timeout=PATIENT)) == found
    silent = Drive(tmp_path / "silent", 0)
    silent.answers = 0
    try:
        assert st.scan(silent.path, [9600], timeout=0.02) == [(9600, "silence", None)]
    finally:
        silent.unplug()
    for port in ("sim:", "socketcan:can0"):
        with pytest.raises(motorlink.InvalidValueError, match="no baud rate"):
            st.scan(port)
