"""The blocking API for RMD motors, on simulated ones."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import motorlink
from conftest import eventually
from motorlink import rmd, sim


@pytest.fixture
def bench() -> sim.Bench:
    return sim.Bench()


@pytest.fixture
def bus(bench: sim.Bench) -> Iterator[rmd.Client]:
    """A client on virtual time, where a timeout takes no real time."""
    with rmd.open(bench, timeout=0.3) as bus:
        yield bus


def mode(bench: sim.Bench, id: int) -> str:
    return str(bench.truth(f"rmd{id}")["mode"])


def test_a_motor_moves_to_an_angle(rmd_bus: rmd.Client) -> None:
    motor = rmd_bus.motor(1)
    status = motor.set_position(90, max_speed_dps=500)
    assert isinstance(status, rmd.MotionStatus) and status.temperature_celsius == 25
    assert rmd_bus.moving == [1]
    eventually(lambda: abs(motor.multi_turn_angle() - 90) < 1, "90 °")
    motor.stop()
    assert rmd_bus.moving == []
    motor.run()
    motor.off()


def test_a_move_that_could_be_nearly_a_full_turn_is_refused_unless_it_is_allowed() -> None:
    near = "[[rmd.motor]]\nid = 1\nplant.angle_degrees = 90.034\n"
    with rmd.open(sim.Bench(near)) as bus:
        motor = bus.motor(1)
        with pytest.raises(motorlink.FullTurnError, match="full_turn=True") as error:
            motor.set_single_turn_position(90, 500)
        assert error.value.motor == 1 and isinstance(error.value, motorlink.InvalidValueError)
        with pytest.raises(motorlink.FullTurnError):
            motor.set_single_turn_position(80, tolerance_degrees=11)
        refused = "^tolerance_degrees: .* is outside 0 to 359.99 °; nothing was sent"
        with pytest.raises(motorlink.InvalidValueError, match=refused):
            motor.set_single_turn_position(80, tolerance_degrees=-1)
        assert bus.moving == []
        motor.set_single_turn_position(90, direction="counterclockwise")
        assert bus.moving == [1]
    allowances: list[dict[str, Any]] = [{"full_turn": True}, {"tolerance_degrees": 0.01}]
    for allowed in allowances:
        bench = sim.Bench(near)
        with rmd.open(bench) as bus:
            bus.motor(1).set_single_turn_position(90, 2000, **allowed)
            bench.run(1)
            assert bus.motor(1).multi_turn_angle() == pytest.approx(450, abs=0.1)


def test_speed_and_torque_turn_the_motor(bench: sim.Bench, bus: rmd.Client) -> None:
    motor = bus.motor(2)
    motor.set_speed(-360)
    bench.run(1)
    assert motor.motion_status().speed_dps == pytest.approx(-360, abs=20)
    motor.set_torque(0.5)
    bench.run(0.05)
    assert motor.motion_status().iq_amps == pytest.approx(0.5, abs=0.1)
    assert sum(motor.phase_currents()) == pytest.approx(0, abs=0.1)
    assert bus.motor(3).status() == (25, 24.0, ((), 0))


def test_gains_and_acceleration_are_kept(bus: rmd.Client) -> None:
    motor = bus.motor(1)
    gains = motor.pid()._replace(position_kp=1, torque_ki=255)
    motor.write_pid_ram(gains)
    motor.write_acceleration_ram(1234)
    with pytest.raises(motorlink.InvalidValueError, match="-1 °/s² is negative.*nothing was sent"):
        motor.write_acceleration_ram(-1)
    with pytest.raises(motorlink.InvalidValueError, match="0 to 255"):
        motor.write_pid_ram(gains._replace(speed_kp=256))
    assert (motor.pid(), motor.acceleration()) == (gains, 1234)


def test_raw_bytes_write_the_rom_only_with_rom_true(bus: rmd.Client) -> None:
    motor = bus.motor(1)
    zero = bytes([0x19]) + bytes(7)
    with pytest.raises(motorlink.InvalidValueError, match="rom=True"):
        motor.raw(zero)
    assert motor.raw(zero, rom=True)[0] == 0x19
    assert motor.write_encoder_offset_rom(7) == motor.encoder().offset == 7
    reply = motor.raw(bytes([0x9A]) + bytes(7))
    assert reply[0] == 0x9A and rmd.decode(0x141, reply, reply=True).values["voltage_volts"] == 24.0


def test_errors_are_named_and_cleared(bench: sim.Bench, bus: rmd.Client) -> None:
    bench.inject("rmd3", "OVER_TEMPERATURE")
    bench.run(0.01)
    errors = bus.motor(3).status().errors
    assert errors.names == ("OVER_TEMPERATURE",) and str(errors) == "over temperature protection"
    assert not bus.motor(3).clear_errors().errors


def test_a_cycle_returns_the_reply_of_each_motor(bus: rmd.Client) -> None:
    answers = bus.cycle(
        {4: rmd.read_status(), 2: rmd.set_torque(0.1), 9: rmd.read_motion_status(), 1: rmd.off()}
    )
    assert list(answers) == [4, 2, 9, 1]
    assert isinstance(answers[4], rmd.Status)
    assert isinstance(answers[2], rmd.MotionStatus)
    assert isinstance(answers[9], motorlink.ReplyTimeoutError) and answers[9].motor == 9
    assert answers[1] is None
    assert bus.cycle({}) == {}


def test_four_torques_in_one_frame(bus: rmd.Client) -> None:
    answers = bus.set_torque4([0.1, 0, -0.1, 0.2])
    assert list(answers) == [1, 2, 3, 4]
    assert all(isinstance(answer, rmd.MotionStatus) for answer in answers.values())
    assert list(bus.set_torque4([0, 0, 0, 0], expect=[2])) == [2]
    with pytest.raises(motorlink.InvalidValueError, match="32 A"):
        bus.set_torque4([0, 0, 33, 0])
    with pytest.raises(motorlink.InvalidValueError, match="not reached"):
        bus.set_torque4([0, 0, 0, 0], expect=[5])


def test_the_end_stops_motors_that_four_torques_reached_unexpectedly(bench: sim.Bench) -> None:
    with rmd.open(bench) as bus:
        bus.set_torque4([0.2, 0.2, 0.2, 0.2], expect=[1])
        assert bus.moving == [1]
        assert mode(bench, 3) == "torque"
    assert [mode(bench, id) for id in (1, 2, 3, 4)] == ["stopped"] * 4
    # Such a motor may be absent.
    with rmd.open(sim.Bench("[[rmd.motor]]\nid = 1")) as bus:
        assert list(bus.set_torque4([0.2, 0.2, 0, 0], expect=[1])) == [1]


def test_a_scan_finds_the_motors(bus: rmd.Client) -> None:
    found = bus.scan()
    assert [(one.id, one.kind) for one in found] == [(id, "motor") for id in (1, 2, 3, 4)]
    assert all(one.status and one.status.voltage_volts == 24.0 for one in found)
    assert [one.id for one in bus.scan([2, 30])] == [2]


def test_limits_hold() -> None:
    # Limits and greatest speeds round towards 0: 360, 90.01, and 62 digits of 0.016 A.
    limits: dict[str, Any] = {"current_limit_amps": 1.0, "speed_limit_dps": 360.9, "angle_limit_degrees": 90.019}
    with rmd.open(sim.Bench(), **limits) as bus:
        motor = bus.motor(1)
        motor.set_position(-90.01, max_speed_dps=360.9)
        motor.set_torque(-1.0)
        bus.set_torque4([1.0, -1.0, 0, 0])
        for beyond in (
            lambda: motor.set_torque(1.01),
            lambda: motor.raw(bytes([0xA1, 0, 0, 0, 63, 0, 0, 0])),
            lambda: motor.set_speed(360.5),
            lambda: motor.set_position(90.02, 1),
            lambda: motor.set_position(10),
            lambda: bus.set_torque4([2, 0, 0, 0]),
        ):
            with pytest.raises(motorlink.InvalidValueError, match="limit"):
                beyond()
        with pytest.raises(motorlink.InvalidValueError, match=r"motor 1: .*limit.*nothing was sent"):
            bus.cycle({5: rmd.set_speed(90), 1: rmd.set_torque(2)})
        assert 5 not in bus.moving


def test_a_limit_that_is_not_given_stays(bus: rmd.Client) -> None:
    motor = bus.motor(1)
    motor.set_limits(speed_limit_dps=100)
    motor.set_limits(current_limit_amps=1)
    motor.set_limits()
    calls: list[Callable[[], object]] = [lambda: motor.set_speed(101), lambda: motor.set_torque(1.1)]
    for beyond in calls:
        with pytest.raises(motorlink.InvalidValueError, match="limit"):
            beyond()
    bus.motor(2).set_torque(1.1)
    motor.set_limits(speed_limit_dps=None)
    motor.set_speed(101)
    with pytest.raises(motorlink.InvalidValueError, match="limit"):
        motor.set_torque(1.1)


def test_arguments_of_another_type_are_named(bus: rmd.Client) -> None:
    motor = bus.motor(1)
    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: bus.cycle([rmd.read_status()]), r"by motor ID, such as `\{1: rmd.read_status\(\)\}`"),  # type: ignore[arg-type]
        (lambda: bus.set_torque4({1: 0.1, 2: 0.1, 3: 0.1, 4: 0.1}), "as a list"),  # type: ignore[arg-type]
        (lambda: motor.write_pid_ram({"speed_kp": 50}), r"`Pid`, such as `motor\.pid\(\)\._replace\(position_kp"),  # type: ignore[arg-type]
        (lambda: bus.scan(4), r"as a list: \[4\]"),  # type: ignore[arg-type]
        (lambda: motor.set_limits(torque_limit=1), "torque_limit"),  # type: ignore[call-arg]
    ]
    for call, said in calls:
        with pytest.raises(TypeError, match=said):
            call()
    assert bus.moving == []


def test_a_stop_is_repeated_until_it_is_confirmed(bench: sim.Bench, bus: rmd.Client) -> None:
    missing = bus.motor(9)
    for stop in (missing.stop, missing.off):
        before = bench.now
        with pytest.raises(motorlink.ReplyTimeoutError):
            stop()
        assert bench.now - before >= 2


def test_stops_that_fail_at_once_are_repeated_with_a_pause(bench: sim.Bench, bus: rmd.Client) -> None:
    attempts: list[int] = []

    def fails(id: int, request: rmd.Request) -> None:
        attempts.append(id)
        # One in 10 ms.
        assert len(attempts) <= 210
        raise motorlink.LinkError("another content")

    client: Any = bus
    client._exchange = fails
    with pytest.raises(motorlink.LinkError, match="another content"):
        bus.motor(1).stop()
    assert len(attempts) >= 4 and bench.now >= 2


def test_invalid_values_are_refused_before_they_are_sent(bus: rmd.Client) -> None:
    motor = bus.motor(1)
    for nonsense in (
        lambda: motor.set_torque(float("nan")),
        lambda: motor.set_torque(32.1),
        lambda: motor.set_speed(1e9),
        lambda: motor.set_position(1, max_speed_dps=0.4),
        lambda: motor.set_single_turn_position(360),
        lambda: motor.set_single_turn_position(1, direction="up"),
        lambda: motor.write_encoder_offset_rom(1.5),  # type: ignore[arg-type]
        lambda: bus.motor(0),
        lambda: bus.motor(33),
        lambda: bus.motor(300),
        lambda: bus.cycle({33: rmd.off()}),
        lambda: motor.raw(b"\x9c"),
        lambda: rmd.open("sim:", timeout=-1),
        lambda: rmd.open("sim:", on_close="maybe"),
        lambda: rmd.open("/dev/ttyACM0"),
        lambda: rmd.decode(0x141, b"", reply=True),
        lambda: rmd.decode(0x7FF, bytes(8), reply=True),
    ):
        with pytest.raises(motorlink.InvalidValueError):
            nonsense()
    assert bus.moving == []


def test_an_absent_motor_is_a_timeout(bus: rmd.Client) -> None:
    with pytest.raises(motorlink.ReplyTimeoutError) as silent:
        _ = bus.motor(20).multi_turn_angle()
    assert silent.value.motor == 20 and "0x92" in str(silent.value)


def test_the_end_of_with_stops_moving_motors(bench: sim.Bench) -> None:
    with pytest.raises(ZeroDivisionError), rmd.open(bench) as bus:
        bus.motor(1).set_speed(100)
        bus.set_torque4([0.1, 0.1, 0, 0])
        assert (mode(bench, 1), mode(bench, 2)) == ("torque", "torque")
        _ = 1 / 0
    assert (mode(bench, 1), mode(bench, 2), mode(bench, 3)) == ("stopped", "stopped", "stopped")
    with rmd.open(bench, on_close="off") as bus:
        bus.motor(1).set_speed(100)
    assert mode(bench, 1) == "off"
    with rmd.open(bench, on_close="nothing") as bus:
        bus.motor(1).set_speed(100)
    assert mode(bench, 1) == "speed"


def test_a_motor_that_cannot_be_stopped_raises(bench: sim.Bench) -> None:
    bus = rmd.open(bench.port(fault="drop=1,only=received"))
    with pytest.raises(motorlink.ReplyTimeoutError):
        bus.motor(2).set_speed(100)
    with pytest.raises(motorlink.LinkError, match="motor 2 may still be running") as lost:
        bus.close()
    assert lost.value.motor == 2 and "closed" in repr(bus)


def test_a_closed_client_raises(tmp_path: Path) -> None:
    bus = rmd.open("sim:")
    assert repr(bus) == "<motorlink.rmd.Client sim:>"
    bus.close()
    bus.close()
    for use in (bus.motor(1).off, bus.scan, lambda: bus.cycle({}), lambda: bus.moving):
        with pytest.raises(motorlink.ClosedError):
            use()
    assert repr(bus.motor(3)) == "<motorlink.rmd.Motor 3 on sim:>"
    with pytest.raises(motorlink.PortError):
        rmd.open(f"slcan:{tmp_path}/nothing")


def test_values_and_requests_are_values(bus: rmd.Client) -> None:
    status = bus.motor(1).status()
    assert pickle.loads(pickle.dumps(status)) == status
    assert rmd.set_speed(1) == rmd.set_speed(1.0) != rmd.set_speed(2)
    assert len({rmd.off(), rmd.off(), rmd.stop()}) == 2
    assert repr(rmd.off()) == "<Request 80 00 00 00 00 00 00 00 (Motor off command)>"
