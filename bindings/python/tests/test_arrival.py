"""``set_position(..., wait=True)``: it returns when the motor has arrived."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import motorlink
from motorlink.errors import InvalidValueError, NotArrivedError, ReplyTimeoutError
from motorlink.sim import Bench

SERVO = 'profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n'


def test_a_move_returns_when_the_motor_is_there() -> None:
    with motorlink.rmd.open(Bench()) as client:
        motor = client.motor(1)
        motion = motor.set_position(-33.3, max_speed_dps=360, wait=True)
        assert motion.speed_dps == 0
        assert motor.multi_turn_angle() == pytest.approx(-33.3, abs=0.15)
        motor.set_single_turn_position(350, 360, direction="clockwise", wait=True)
        assert motor.multi_turn_angle() == pytest.approx(-10, abs=0.15)


def test_an_st_move_returns_when_the_motor_is_there() -> None:
    with motorlink.st.open(Bench(SERVO), profile="mcsdk-5.4") as client:
        motor = client.motor(1)
        with pytest.raises(NotArrivedError) as caught:
            motor.set_position(3.0, 0.5, wait=True)
        message = "motor 1 did not arrive: the motor is in IDLE, not in RUN; the move was not sent"
        assert str(caught.value) == message and motor.get("MOVE_DURATION") == 0
        motor.start()
        motor.set_position(3.0, 0.5, wait=True)
        assert motor.get("CURRENT_POSITION") == pytest.approx(3.0, abs=0.011)


def test_a_motor_that_needs_longer_raises() -> None:
    with motorlink.rmd.open(Bench()) as client:
        with pytest.raises(NotArrivedError, match="the time is over and the motor is moving") as caught:
            client.motor(1).set_position(36000, max_speed_dps=360, wait=True, timeout=0.5)
        assert caught.value.motor == 1
        assert "° from its target; the motor still has its command and may still be turning" in str(caught.value)
        assert client.moving == [1]


def test_a_motor_that_is_silent_raises_the_error_of_the_line() -> None:
    bench = Bench()
    with motorlink.rmd.open(bench) as client:
        with pytest.raises(ReplyTimeoutError, match="motor 9"):
            client.motor(9).set_position(90, wait=True)
        assert client.moving == []
        meddled: Any = client
        exchange = client._exchange
        # From its command on the questions reach no motor.
        meddled._exchange = lambda id, request: exchange(9 if client.moving else id, request)
        began = bench.now
        with pytest.raises(ReplyTimeoutError, match="motor 9"):
            client.motor(1).set_position(90, max_speed_dps=10, wait=True)
        # One lost reply does not end the wait.
        assert client.moving == [1] and bench.now - began > 1


def test_arguments_of_the_wait_are_checked_before_the_move() -> None:
    with motorlink.rmd.open(Bench()) as client:
        motor = client.motor(1)
        with pytest.raises(InvalidValueError, match="^timeout without wait=True"):
            motor.set_position(90, timeout=1.0)
        with pytest.raises(InvalidValueError, match="^arrival_tolerance_degrees and timeout without"):
            motor.set_single_turn_position(90, arrival_tolerance_degrees=0.1, timeout=1.0)
        for wrong in (-0.1, float("nan"), 1e12):
            with pytest.raises(InvalidValueError):
                motor.set_position(90, wait=True, arrival_tolerance_degrees=wrong)
        assert client.moving == []
    with motorlink.st.open(Bench(SERVO), profile="mcsdk-5.4") as client_st:
        with pytest.raises(InvalidValueError, match="^arrival_tolerance_rad without wait=True"):
            client_st.motor(1).set_position(3.0, 0.5, arrival_tolerance_rad=0.1)


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
