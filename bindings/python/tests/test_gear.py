"""``gear_ratio``: all angles, speeds and accelerations are those of the output shaft, once."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from types import MappingProxyType
from typing import Any

import pytest

import motorlink
from conftest import PATIENT
from motorlink import rmd
from motorlink.sim import Bench

RATIO = 6


@pytest.fixture
def both() -> Iterator[tuple[rmd.Client, rmd.Client]]:
    """The same motors at the output shaft and at the motor shaft."""
    bench = Bench()
    with rmd.open(bench, gear_ratio=RATIO) as geared, rmd.open(bench, on_close="nothing") as plain:
        yield geared, plain


def near(value: float, within: float = 1e-9) -> Any:
    return pytest.approx(value, abs=within)


def test_a_move_and_its_readings_are_those_of_the_output_shaft(
    both: tuple[rmd.Client, rmd.Client],
) -> None:
    motor, plain = (client.motor(1) for client in both)
    assert (motor.gear_ratio, plain.gear_ratio) == (RATIO, None)
    motor.set_position(30, max_speed_dps=60, wait=True)
    # 0.1° at the motor shaft is the tolerance.
    assert plain.multi_turn_angle() == near(30 * RATIO, 0.1)
    assert motor.multi_turn_angle() == near(plain.multi_turn_angle() / RATIO)
    assert motor.single_turn_angle() == near(plain.single_turn_angle() / RATIO)
    assert motor.encoder() == plain.encoder()
    motor.write_acceleration_ram(100)
    assert (motor.acceleration(), plain.acceleration()) == (100, 600)
    assert isinstance(plain.acceleration(), int)
    with pytest.raises(motorlink.InvalidValueError, match="3579139.411"):
        motor.set_position(30, wait=True, arrival_tolerance_degrees=4_000_000)


def test_a_speed_is_that_of_the_output_shaft_in_each_reply(
    both: tuple[rmd.Client, rmd.Client],
) -> None:
    geared, plain = both
    motor = geared.motor(1)
    motor.set_speed(60)
    while plain.motor(1).motion_status().speed_dps < 355:
        pass
    speed = rmd.set_speed(60, gear_ratio=RATIO)
    status = rmd.read_motion_status(gear_ratio=RATIO)
    readings = {
        "motor": motor.motion_status().speed_dps,
        "reply of a motion": motor.set_speed(60).speed_dps,
        "exchange": geared.exchange(1, status).speed_dps,
        "cycle": geared.cycle({1: speed})[1].speed_dps,
        "sample": geared.sample(["speed_dps"], rate=100, seconds=0.02)["speed_dps"][0],
    }
    assert readings == {name: near(60, 1) for name in readings}
    assert geared.sample(["speed_dps"], rate=100, seconds=0.02, raw=True)["speed_dps"][0] > 350
    before = plain.motor(1).multi_turn_angle() / RATIO
    angles = geared.sample(["multi_turn_angle_degrees"], rate=100, seconds=0.02)
    after = plain.motor(1).multi_turn_angle() / RATIO
    assert before - 0.1 <= angles["multi_turn_angle_degrees"][-1] <= after + 0.1
    first = geared.set_torque4([0, 0, 0, 0])[1]
    assert isinstance(first, rmd.MotionStatus) and 40 < first.speed_dps < 61


@pytest.mark.parametrize("how", ["open", "set_limits"])
def test_limits_are_those_of_the_output_shaft(how: str) -> None:
    limits: dict[str, Any] = {"speed_limit_dps": 60.0, "angle_limit_degrees": 30.0}
    given: dict[str, Any] = limits if how == "open" else {}
    with rmd.open(Bench(), gear_ratio=RATIO, **given) as client:
        motor = client.motor(1)
        if how == "set_limits":
            motor.set_limits(**limits)
        motor.set_speed(60)
        motor.set_position(30, max_speed_dps=60)
        calls: list[Callable[[], object]] = [
            lambda: motor.set_speed(60.1),
            lambda: motor.set_position(30.1, max_speed_dps=60),
        ]
        for beyond in calls:
            with pytest.raises(motorlink.InvalidValueError, match="beyond the limit"):
                beyond()


def test_a_ratio_by_id_is_that_of_its_motor() -> None:
    bench = Bench()
    with rmd.open(bench, gear_ratio=MappingProxyType({1: 6, 2: 9}), speed_limit_dps=10) as client:
        client.motor(2).set_position(5, max_speed_dps=10)
        bench.run(2)
        data = client.sample({1: ["multi_turn_angle_degrees"], 2: ["multi_turn_angle_degrees"]}, rate=20, seconds=0.1)
        assert data["multi_turn_angle_degrees_1"][0] == pytest.approx(0, abs=0.1)
        assert data["multi_turn_angle_degrees_2"][0] == pytest.approx(5, abs=0.1)
        assert [client.motor(id).gear_ratio for id in (1, 2, 3)] == [6, 9, None]
        for id in (1, 2, 3):
            client.motor(id).set_speed(10)
            with pytest.raises(motorlink.InvalidValueError, match="beyond the limit"):
                client.motor(id).set_speed(11)


def test_a_request_for_another_shaft_than_that_of_its_motor_is_refused() -> None:
    with rmd.open(Bench(), gear_ratio={1: RATIO}) as client:
        wrong = [(1, rmd.set_speed(60)), (1, rmd.read_motion_status(gear_ratio=9))]
        wrong += [(2, rmd.set_speed(60, gear_ratio=RATIO)), (1, rmd.Request.decode(bytes([0xA2] + 7 * [0])))]
        for id, request in wrong:
            for ask in (lambda: client.exchange(id, request), lambda: client.cycle({id: request})):
                with pytest.raises(motorlink.InvalidValueError, match="gear ratio"):
                    ask()
        with pytest.raises(motorlink.InvalidValueError, match="use set_position"):
            client.motor(1).set_single_turn_position(10, full_turn=True)
        assert client.moving == []
        # These have no angle and no speed.
        client.cycle({1: rmd.read_status(), 2: rmd.off()})
        client.motor(1).raw(bytes([0x9C] + 7 * [0]))
        client.motor(2).set_single_turn_position(10, full_turn=True)


def test_a_ratio_that_is_none_is_refused() -> None:
    for ratio in (0, -6, math.nan, math.inf, {1: 0.0}, {33: 6.0}):
        with pytest.raises(motorlink.InvalidValueError):
            rmd.open(Bench(), gear_ratio=ratio)
    with pytest.raises(motorlink.InvalidValueError, match="is not a gear ratio"):
        rmd.set_speed(1, gear_ratio=0)
    wrong: list[Any] = ["6", {1: "6"}, {"1": 6}]
    for ratio in wrong:
        with pytest.raises(TypeError, match="gear_ratio is a number, or a dict of numbers by ID, not"):
            rmd.open(Bench(), gear_ratio=ratio)


def test_the_gear_is_in_asyncio_too() -> None:
    async def main() -> None:
        async with motorlink.aio.rmd.open(
            "sim:", gear_ratio=RATIO, speed_limit_dps=60, timeout=PATIENT
        ) as client:
            motor = client.motor(1)
            await motor.set_position(15, max_speed_dps=60, wait=True)
            raw = await motor.raw(bytes([0x92] + 7 * [0]))
            assert int.from_bytes(raw[1:], "little") / 100 == near(15 * RATIO, 0.2)
            data = await client.sample(["multi_turn_angle_degrees"], rate=100, seconds=0.02)
            assert data["multi_turn_angle_degrees"][0] == near(15, 0.1)
            with pytest.raises(motorlink.InvalidValueError, match="beyond the limit"):
                await motor.set_speed(60.1)
            with pytest.raises(motorlink.InvalidValueError, match="gear ratio"):
                await client.cycle({1: rmd.set_speed(1)})
            first = (await client.set_torque4([0, 0, 0, 0]))[1]
            assert isinstance(first, rmd.MotionStatus) and abs(first.speed_dps) < 10

    asyncio.run(main())


def test_encoder_counts_have_an_angle() -> None:
    assert rmd.encoder_degrees(0x8000, encoder_bits=18) == 180
    assert rmd.encoder_degrees(8192, encoder_bits=14, gear_ratio=6) == near(30)
    for counts, bits, said in ((4096, 12, "counts"), (-1, 14, "counts"), (0, 19, "12 to 18 bits")):
        with pytest.raises(motorlink.InvalidValueError, match=said):
            rmd.encoder_degrees(counts, encoder_bits=bits)
