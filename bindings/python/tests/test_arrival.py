"""``set_position(..., wait=True)``: it returns when the motor has arrived."""

from __future__ import annotations

import asyncio

import pytest

import motorlink
from motorlink.errors import InvalidValueError, NotArrivedError, ReplyTimeoutError
from motorlink.sim import Bench

SERVO = 'profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n'


@pytest.mark.parametrize("degrees", [90, -33.3, 0.3])
def test_a_move_returns_when_the_motor_is_there(degrees: float) -> None:
    bench = Bench()
    with motorlink.rmd.open(bench) as client:
        motor = client.motor(1)
        motion = motor.set_position(degrees, max_speed_dps=360, wait=True)
        assert motion.speed_dps == 0
        assert motor.multi_turn_angle() == pytest.approx(degrees, abs=0.15)
        bench.run(1.0)
        assert motor.multi_turn_angle() == pytest.approx(degrees, abs=0.15)


def test_a_move_within_the_turn_returns_when_the_motor_is_there() -> None:
    with motorlink.rmd.open(Bench()) as client:
        motor = client.motor(1)
        motor.set_single_turn_position(350, 360, direction="counterclockwise", wait=True)
        assert motor.multi_turn_angle() == pytest.approx(-10, abs=0.15)


def test_a_full_turn_that_begins_slowly_is_waited_for() -> None:
    with motorlink.rmd.open(Bench()) as client:
        motor = client.motor(1)
        motor.set_position(0.1, wait=True, arrival_tolerance_degrees=0.03)
        motor.write_acceleration_ram(20)
        before = motor.multi_turn_angle()
        motor.set_single_turn_position(0, 360, full_turn=True, wait=True)
        assert motor.multi_turn_angle() - before > 359


def test_a_motor_that_lost_its_turns_raises() -> None:
    bench = Bench()
    with motorlink.rmd.open(bench) as client:
        client.motor(1).set_position(720, wait=True)

    async def main(port: str) -> None:
        async with motorlink.aio.rmd.open(port, timeout=5.0) as client:
            task = asyncio.create_task(client.motor(1).set_position(0, 10, wait=True))
            while client.moving != [1] and not task.done():
                await asyncio.sleep(0)
            bench.power_cycle("rmd1")
            with pytest.raises(NotArrivedError, match="lost its counted turns"):
                await task

    with bench.serve() as serving:
        asyncio.run(main(serving.rmd))


def test_a_motor_that_needs_longer_raises() -> None:
    with motorlink.rmd.open(Bench()) as client:
        with pytest.raises(NotArrivedError, match="the time is over and the motor is moving") as caught:
            client.motor(1).set_position(36000, max_speed_dps=360, wait=True, timeout=0.5)
        assert caught.value.motor == 1
        assert client.moving == [1]


def test_the_error_says_what_happened_and_what_the_motor_does_now() -> None:
    bench = Bench()
    with motorlink.rmd.open(bench) as client, pytest.raises(NotArrivedError) as caught:
        client.motor(1).set_position(36000, max_speed_dps=360, wait=True, timeout=0.5)
    assert "° from its target; the motor still has its command and may still be turning" in str(caught.value)
    bench = Bench(SERVO)
    with motorlink.st.open(bench, profile="mcsdk-5.4") as client_st, pytest.raises(NotArrivedError) as caught:
        client_st.motor(1).set_position(3.0, 0.5, wait=True)
    message = "motor 1 did not arrive: the motor is in IDLE, not in RUN; the move was not sent"
    assert str(caught.value) == message


def test_arguments_of_the_wait_are_refused_without_it() -> None:
    with motorlink.rmd.open(Bench()) as client:
        motor = client.motor(1)
        with pytest.raises(InvalidValueError, match="^timeout without wait=True"):
            motor.set_position(90, timeout=1.0)
        with pytest.raises(InvalidValueError, match="^arrival_tolerance_degrees and timeout without"):
            motor.set_single_turn_position(90, arrival_tolerance_degrees=0.1, timeout=1.0)
        assert client.moving == []
    with motorlink.st.open(Bench(SERVO), profile="mcsdk-5.4") as client_st:
        with pytest.raises(InvalidValueError, match="^arrival_tolerance_rad without wait=True"):
            client_st.motor(1).set_position(3.0, 0.5, arrival_tolerance_rad=0.1)
        assert client_st.motor(1).get("MOVE_DURATION") == 0


def test_a_motor_that_is_held_raises() -> None:
    bench = Bench()
    bench.lock_rotor("rmd1")
    with motorlink.rmd.open(bench) as client, pytest.raises(NotArrivedError, match="stopped before"):
        client.motor(1).set_position(90, wait=True)


def test_a_motor_that_is_not_there_raises() -> None:
    client = motorlink.rmd.open(Bench(), on_close="nothing")
    with client, pytest.raises(ReplyTimeoutError):
        client.motor(9).set_position(90, wait=True)


@pytest.mark.parametrize("wrong", [-0.1, float("nan"), 1e12])
def test_a_tolerance_that_cannot_be_is_refused(wrong: float) -> None:
    with motorlink.rmd.open(Bench()) as client:
        with pytest.raises(InvalidValueError):
            client.motor(1).set_position(90, wait=True, arrival_tolerance_degrees=wrong)
        assert client.moving == []


def test_an_st_move_returns_when_the_motor_is_there() -> None:
    with motorlink.st.open(Bench(SERVO), profile="mcsdk-5.4") as client:
        motor = client.motor(1)
        motor.start()
        motor.set_position(3.0, 0.5, wait=True)
        assert motor.get("CURRENT_POSITION") == pytest.approx(3.0, abs=0.011)


def test_an_st_motor_that_is_not_running_gets_no_move() -> None:
    with motorlink.st.open(Bench(SERVO), profile="mcsdk-5.4") as client:
        motor = client.motor(1)
        with pytest.raises(NotArrivedError, match="IDLE, not in RUN"):
            motor.set_position(3.0, 0.5, wait=True)
        assert motor.get("MOVE_DURATION") == 0


def test_tasks_wait_for_their_motors() -> None:
    async def main() -> None:
        async with motorlink.aio.rmd.open("sim:") as client:
            one, two = client.motor(1), client.motor(2)
            await asyncio.gather(
                one.set_position(45, max_speed_dps=360, wait=True),
                two.set_position(-90, max_speed_dps=360, wait=True),
            )
            assert await one.multi_turn_angle() == pytest.approx(45, abs=0.15)
            assert await two.multi_turn_angle() == pytest.approx(-90, abs=0.15)

    asyncio.run(main())
