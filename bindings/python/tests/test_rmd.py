"""The blocking API for RMD motors, on simulated ones."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import motorlink
from conftest import PATIENT, Served, eventually
from motorlink import rmd, sim


def test_a_motor_moves_to_an_angle(rmd_bus: rmd.Client) -> None:
    motor = rmd_bus.motor(1)
    status = motor.set_position(90, max_speed_dps=500)
    assert isinstance(status, rmd.MotionStatus) and status.temperature_celsius == 25
    assert rmd_bus.moving == [1]
    eventually(lambda: abs(motor.multi_turn_angle() - 90) < 1, "90 °")
    motor.set_single_turn_position(45, 500, direction="counterclockwise")
    eventually(lambda: abs(motor.single_turn_angle() - 45) < 1, "45 °")
    motor.stop()
    assert rmd_bus.moving == []
    motor.run()
    motor.off()


NEAR = """
[[rmd.motor]]
id = 1
plant.angle_degrees = 90.034
"""


def test_a_move_that_could_be_nearly_a_full_turn_is_refused() -> None:
    bench = sim.Bench(NEAR)
    with rmd.open(bench) as bus:
        motor = bus.motor(1)
        assert motor.single_turn_angle() == 90.02
        for target, refused in ((90.02, True), (90, True), (89.52, True), (89.51, False)):
            if refused:
                with pytest.raises(motorlink.FullTurnError, match="full_turn=True") as error:
                    motor.set_single_turn_position(target, 500)
                assert error.value.motor == 1 and isinstance(error.value, motorlink.InvalidValueError)
                assert bus.moving == []
            else:
                motor.set_single_turn_position(target, 500)
                assert bus.moving == [1]


def test_a_full_turn_and_its_tolerance_can_be_allowed() -> None:
    allowances: list[dict[str, Any]] = [{"full_turn": True}, {"tolerance_degrees": 0.01}]
    for allowed in allowances:
        bench = sim.Bench(NEAR)
        with rmd.open(bench) as bus:
            motor = bus.motor(1)
            motor.set_single_turn_position(90, 2000, **allowed)
            bench.run(1)
            assert motor.multi_turn_angle() == pytest.approx(450, abs=0.1)
    with rmd.open(sim.Bench(NEAR)) as bus:
        bus.motor(1).set_single_turn_position(90, direction="counterclockwise")
        with pytest.raises(motorlink.FullTurnError):
            bus.motor(1).set_single_turn_position(80, tolerance_degrees=11)
        for nonsense in (-1, float("nan")):
            refused = "^tolerance_degrees: .* is outside 0 to 359.99 °; nothing was sent"
            with pytest.raises(motorlink.InvalidValueError, match=refused):
                bus.motor(1).set_single_turn_position(80, tolerance_degrees=nonsense)


def test_speed_and_torque_turn_the_motor(rmd_bus: rmd.Client) -> None:
    motor = rmd_bus.motor(2)
    motor.set_speed(-360)
    eventually(lambda: abs(motor.motion_status().speed_dps + 360) < 20, "-360 °/s")
    motor.set_torque(0.5)
    eventually(lambda: abs(motor.motion_status().iq_amps - 0.5) < 0.1, "0.5 A")
    assert sum(motor.phase_currents()) == pytest.approx(0, abs=0.1)
    assert motor.status() == (motor.status().temperature_celsius, 24.0, ((), 0))


def test_gains_and_acceleration_are_kept(rmd_bus: rmd.Client) -> None:
    motor = rmd_bus.motor(1)
    gains = motor.pid()._replace(position_kp=1, torque_ki=255)
    motor.write_pid_ram(gains)
    assert motor.pid() == gains
    motor.write_acceleration_ram(1234)
    assert motor.acceleration() == 1234
    with pytest.raises(motorlink.InvalidValueError, match="-1 °/s² is negative.*nothing was sent"):
        motor.write_acceleration_ram(-1)
    assert motor.acceleration() == 1234
    for nonsense in (gains._replace(speed_kp=256), gains._replace(speed_kp=-1)):
        with pytest.raises(motorlink.InvalidValueError, match="0 to 255"):
            motor.write_pid_ram(nonsense)
    assert motor.pid() == gains


def test_raw_bytes_write_the_rom_only_with_rom_true(served: Served) -> None:
    with rmd.open(served.can, timeout=PATIENT) as bus:
        motor = bus.motor(1)

        def writes() -> object:
            return served.motor("rmd", 1)["rom_writes"]

        with pytest.raises(motorlink.InvalidValueError, match="rom=True"):
            motor.raw(bytes([0x19, 0, 0, 0, 0, 0, 0, 0]))
        motor.write_pid_ram(motor.pid())
        assert writes() == 0
        motor.write_pid_rom(motor.pid())
        assert motor.write_encoder_offset_rom(7) == motor.encoder().offset == 7
        assert isinstance(motor.write_zero_rom(), int)
        assert writes() == 3


def test_errors_are_named_and_cleared(served: Served) -> None:
    with rmd.open(served.can, timeout=PATIENT) as bus:
        motor, port = bus.motor(3), f"slcan-pty:{served.can.removeprefix('slcan:')}"
        served.do("fault", port=port, motor=3, fault="OVER_TEMPERATURE")
        errors = eventually(lambda: motor.status().errors, "the error")
        assert errors.names == ("OVER_TEMPERATURE",) and str(errors) == "over temperature protection"
        assert not motor.clear_errors().errors


@pytest.fixture
def brief_bus() -> Iterator[rmd.Client]:
    """A client on virtual time, where a timeout takes no real time."""
    with rmd.open(sim.Bench(), timeout=0.3) as bus:
        yield bus


def test_a_cycle_returns_the_reply_of_each_motor(brief_bus: rmd.Client) -> None:
    answers = brief_bus.cycle(
        {4: rmd.read_status(), 2: rmd.set_torque(0.1), 9: rmd.read_motion_status(), 1: rmd.off()}
    )
    assert list(answers) == [4, 2, 9, 1]
    assert isinstance(answers[4], rmd.Status)
    assert isinstance(answers[2], rmd.MotionStatus)
    assert isinstance(answers[9], motorlink.ReplyTimeoutError) and answers[9].motor == 9
    assert answers[1] is None
    assert brief_bus.cycle({}) == {}
    with pytest.raises(motorlink.InvalidValueError):
        brief_bus.cycle({33: rmd.off()})


def test_four_torques_in_one_frame(rmd_bus: rmd.Client) -> None:
    answers = rmd_bus.set_torque4([0.1, 0, -0.1, 0.2])
    assert list(answers) == [1, 2, 3, 4]
    assert all(isinstance(answer, rmd.MotionStatus) for answer in answers.values())
    assert list(rmd_bus.set_torque4([0, 0, 0, 0], expect=[2])) == [2]
    with pytest.raises(motorlink.InvalidValueError, match="32 A"):
        rmd_bus.set_torque4([0, 0, 33, 0])
    with pytest.raises(motorlink.InvalidValueError, match="not reached"):
        rmd_bus.set_torque4([0, 0, 0, 0], expect=[5])


def test_a_scan_finds_the_motors(brief_bus: rmd.Client) -> None:
    found = brief_bus.scan()
    assert [(one.id, one.kind) for one in found] == [(id, "motor") for id in (1, 2, 3, 4)]
    assert all(one.status and one.status.voltage_volts == 24.0 for one in found)
    assert [one.id for one in brief_bus.scan([2, 30])] == [2]


def test_limits_hold() -> None:
    limits: dict[str, Any] = {"current_limit_amps": 1.0, "speed_limit_dps": 360, "angle_limit_degrees": 90}
    with rmd.open("sim:", timeout=PATIENT, **limits) as bus:
        motor = bus.motor(1)
        motor.set_position(-90, max_speed_dps=360)
        # A digit is 0.016 A: both the limit and the current become 62 digits, 0.992 A.
        motor.set_torque(1.0)
        motor.set_torque(-1.0)
        bus.set_torque4([1.0, -1.0, 0, 0])
        for beyond in (
            lambda: motor.set_torque(1.01),
            lambda: motor.set_torque(-1.01),
            lambda: motor.raw(bytes([0xA1, 0, 0, 0, 63, 0, 0, 0])),
            lambda: motor.set_speed(360.01),
            lambda: motor.set_position(90.01, 1),
            lambda: motor.set_position(10),
            lambda: motor.raw(bytes([0xA4, 0, 0, 0, 0, 0, 0, 0])),
            lambda: motor.raw(bytes([0xA1, 0, 0, 0, 0xFF, 0, 0, 0])),
            lambda: bus.set_torque4([2, 0, 0, 0]),
        ):
            with pytest.raises(motorlink.InvalidValueError, match="limit"):
                beyond()
        with pytest.raises(motorlink.InvalidValueError, match=r"motor 1: .*limit.*nothing was sent"):
            bus.cycle({5: rmd.set_speed(90), 1: rmd.set_torque(2)})
        assert 5 not in bus.moving
        motor.set_limits(current_limit_amps=3)
        motor.set_torque(2.5)
        bus.motor(2).set_torque(0.9)
        with pytest.raises(motorlink.InvalidValueError):
            bus.motor(2).set_torque(2.5)


def test_a_limit_that_is_not_given_stays() -> None:
    with rmd.open("sim:", timeout=PATIENT) as bus:
        motor = bus.motor(1)
        motor.set_limits(speed_limit_dps=100)
        motor.set_limits(current_limit_amps=1)
        motor.set_limits()
        calls: list[Callable[[], object]] = [lambda: motor.set_speed(101), lambda: motor.set_torque(1.1)]
        for beyond in calls:
            with pytest.raises(motorlink.InvalidValueError, match="limit"):
                beyond()
        motor.set_limits(speed_limit_dps=None)
        motor.set_speed(101)
        with pytest.raises(motorlink.InvalidValueError, match="limit"):
            motor.set_torque(1.1)
        with pytest.raises(TypeError, match="torque_limit"):
            motor.set_limits(torque_limit=1)  # type: ignore[call-arg]


def test_a_cycle_needs_a_mapping(rmd_bus: rmd.Client) -> None:
    with pytest.raises(TypeError, match=r"by motor ID, such as `\{1: rmd.read_status\(\)\}`"):
        rmd_bus.cycle([rmd.read_status()])  # type: ignore[arg-type]


TWO = """
[[rmd.motor]]
id = 1
[[rmd.motor]]
id = 2
"""


def test_the_end_stops_motors_that_four_torques_reached_unexpectedly(served: Served) -> None:
    with rmd.open(served.can, timeout=PATIENT) as bus:
        bus.set_torque4([0.2, 0.2, 0.2, 0.2], expect=[1])
        assert bus.moving == [1]
        assert served.motor("rmd", 3)["mode"] == "torque"
    assert [served.motor("rmd", id)["mode"] for id in (1, 2, 3, 4)] == ["stopped"] * 4


def test_a_motor_that_four_torques_reach_unexpectedly_may_be_absent() -> None:
    with rmd.open(sim.Bench(TWO)) as bus:
        assert list(bus.set_torque4([0.2, 0.2, 0, 0], expect=[1, 2])) == [1, 2]


def test_a_stop_is_repeated_until_it_is_confirmed(served: Served) -> None:
    with rmd.open(served.can, timeout=0.05) as bus:
        missing = bus.motor(9)
        for stop in (missing.stop, missing.off):
            before = time.monotonic()
            with pytest.raises(motorlink.ReplyTimeoutError):
                stop()
            assert time.monotonic() - before >= 2


def test_limits_and_max_speeds_round_towards_0() -> None:
    with rmd.open("sim:", timeout=PATIENT, speed_limit_dps=360.9, angle_limit_degrees=90.019) as bus:
        motor = bus.motor(1)
        motor.set_position(90.01, max_speed_dps=360.9)
        calls: list[Callable[[], object]] = [
            lambda: motor.set_speed(360.5),
            lambda: motor.set_position(90.02, max_speed_dps=1),
            lambda: motor.set_position(1, max_speed_dps=361),
        ]
        for beyond in calls:
            with pytest.raises(motorlink.InvalidValueError, match="limit"):
                beyond()
    # 0.3 is 30 digits of 0.01, although binary fractions are not exact.
    with rmd.open("sim:", timeout=PATIENT, angle_limit_degrees=0.3, current_limit_amps=0.48) as bus:
        bus.motor(1).set_position(0.3)
        bus.motor(1).set_torque(0.48)


@pytest.mark.parametrize("most", [0, 0.4, 0.999, -1, -0.5, float("-inf"), float("nan")])
def test_a_max_speed_that_would_be_0_is_refused(most: float) -> None:
    requests: list[Callable[[], object]] = [
        lambda: rmd.set_position_limited(angle_degrees=1, max_speed_dps=most),
        lambda: rmd.set_single_turn_position_limited(
            angle_degrees=1, max_speed_dps=most, direction="clockwise"
        ),
    ]
    for request in requests:
        with pytest.raises(motorlink.InvalidValueError, match="outside 1 to 65535 °/s; nothing was sent"):
            request()


def test_a_max_speed_never_rounds_up() -> None:
    for most, digits in ((1, 1), (1.999, 1), (360.5, 360), (360.999, 360), (65535.9, 65535)):
        for request in (
            rmd.set_position_limited(angle_degrees=1, max_speed_dps=most),
            rmd.set_single_turn_position_limited(
                angle_degrees=1, max_speed_dps=most, direction="CLOCKWISE"
            ),
        ):
            assert int.from_bytes(request.encode()[2:4], "little") == digits
    with pytest.raises(motorlink.InvalidValueError, match="outside 1 to 65535 °/s; nothing was sent"):
        rmd.set_position_limited(angle_degrees=1, max_speed_dps=65536)


def test_invalid_values_are_refused_before_they_are_sent(rmd_bus: rmd.Client) -> None:
    motor = rmd_bus.motor(1)
    for nonsense in (
        lambda: motor.set_torque(float("nan")),
        lambda: motor.set_torque(32.1),
        lambda: motor.set_speed(1e9),
        lambda: motor.set_position(1e9),
        lambda: motor.set_position(1, max_speed_dps=-1),
        lambda: motor.set_single_turn_position(360),
        lambda: motor.set_single_turn_position(-1),
        lambda: motor.set_single_turn_position(1, direction="up"),
        lambda: motor.write_encoder_offset_rom(1.5),  # type: ignore[arg-type]
        lambda: rmd_bus.motor(0).off(),
        lambda: rmd_bus.motor(33).off(),
        lambda: motor.raw(b"\x9c"),
        lambda: rmd.open("sim:", timeout=-1),
        lambda: rmd.open("sim:", on_close="maybe"),
        lambda: rmd.open("/dev/ttyACM0"),
        lambda: rmd.decode(0x141, b"", reply=True),
        lambda: rmd.decode(0x7FF, bytes(8), reply=True),
    ):
        with pytest.raises(motorlink.InvalidValueError):
            nonsense()
    assert rmd_bus.moving == []


def test_an_absent_motor_is_a_timeout(brief_bus: rmd.Client) -> None:
    with pytest.raises(motorlink.ReplyTimeoutError) as silent:
        _ = brief_bus.motor(20).multi_turn_angle()
    assert silent.value.motor == 20 and "0x92" in str(silent.value)


def test_raw_bytes(rmd_bus: rmd.Client) -> None:
    reply = rmd_bus.motor(1).raw(bytes([0x9A]) + bytes(7))
    assert reply[0] == 0x9A and rmd.decode(0x141, reply, reply=True).values["voltage_volts"] == 24.0


def test_the_end_of_with_stops_moving_motors(served: Served) -> None:
    def mode(motor: int) -> object:
        return served.motor("rmd", motor)["mode"]

    with pytest.raises(ZeroDivisionError), rmd.open(served.can, timeout=PATIENT) as bus:
        bus.motor(1).set_speed(100)
        bus.set_torque4([0.1, 0.1, 0, 0])
        assert (mode(1), mode(2)) == ("torque", "torque")
        _ = 1 / 0
    assert (mode(1), mode(2), mode(3)) == ("stopped", "stopped", "stopped")
    with rmd.open(served.can, timeout=PATIENT, on_close="off") as bus:
        bus.motor(1).set_speed(100)
    assert mode(1) == "off"
    with rmd.open(served.can, timeout=PATIENT, on_close="nothing") as bus:
        bus.motor(1).set_speed(100)
    assert mode(1) == "speed"


def test_a_motor_that_cannot_be_stopped_raises(served: Served) -> None:
    bus = rmd.open(served.can, timeout=PATIENT)
    bus.motor(2).set_speed(100)
    served.end()
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


def test_values_and_requests_are_values(rmd_bus: rmd.Client) -> None:
    status = rmd_bus.motor(1).status()
    assert pickle.loads(pickle.dumps(status)) == status
    assert rmd.set_speed(1) == rmd.set_speed(1.0) != rmd.set_speed(2)
    assert len({rmd.off(), rmd.off(), rmd.stop()}) == 2
    assert repr(rmd.off()) == "<Request 80 00 00 00 00 00 00 00 (Motor off command)>"


@pytest.mark.parametrize("id", [-1, 0, 33, 300])
def test_a_motor_that_cannot_exist_is_refused_at_once(brief_bus: rmd.Client, id: int) -> None:
    with pytest.raises(motorlink.InvalidValueError, match="1 to 32"):
        brief_bus.motor(id)


def test_a_dict_of_currents_is_not_taken_for_its_keys() -> None:
    with rmd.open("sim:") as client:
        with pytest.raises(TypeError, match="as a list"):
            client.set_torque4({1: 0.1, 2: 0.1, 3: 0.1, 4: 0.1})  # type: ignore[arg-type]
        assert client.moving == []


def test_gains_and_ids_of_another_type_are_named() -> None:
    with rmd.open("sim:") as client:
        motor = client.motor(1)
        with pytest.raises(TypeError, match=r"`Pid`, such as `motor\.pid\(\)\._replace\(position_kp"):
            motor.write_pid_ram({"speed_kp": 50})  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=r"as a list: \[4\]"):
            client.scan(4)  # type: ignore[arg-type]
