"""Values of a drive that follows another profile than the client."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

import motorlink
from motorlink import aio, st

COLD = 'profile = "mcsdk-5.4"\n[[st.motor]]\nplant.heat.ambient = -10.0\n'
MESSAGE = "sim:.*: motor 1: HEATS_TEMP is 65526 °C in profile spec, .* -10 °C in profile mcsdk-5.4"


@pytest.fixture
def cold(tmp_path: Path) -> str:
    """The port of a drive of ``mcsdk-5.4`` at -10 °C."""
    config = tmp_path / "cold.toml"
    config.write_text(COLD)
    return f"sim:{config}"


def check(error: motorlink.ImplausibleValueError) -> None:
    assert (error.motor, error.register, error.digits) == (1, "HEATS_TEMP", 65526)
    assert error.profile == "mcsdk-5.4" and error.port is not None


def test_a_value_that_is_plausible_in_the_other_profile_only_raises(cold: str) -> None:
    with st.open(cold) as bus:
        motor = bus.motor(1)
        with pytest.raises(motorlink.ImplausibleValueError, match=MESSAGE) as wrong:
            motor.get("HEATS_TEMP")
        check(wrong.value)
        assert motor.get("HEATS_TEMP", raw=True) == 65526
        for read in (lambda: motor.registers["HEATS_TEMP"], motor.registers.get_all):
            with pytest.raises(motorlink.ImplausibleValueError):
                read()
        assert motor.get("BUS_VOLTAGE") == 325 and motor.status() == "IDLE"
        with pytest.raises(motorlink.InvalidValueError, match="0 to 100 %"):
            motor.set("FLUXWK_BUS", 985)
        motor.set("FLUXWK_BUS", 900, raw=True)
    with st.open(cold, profile="mcsdk-5.4") as bus:
        assert bus.motor(1).get("HEATS_TEMP") == -10


def test_a_sample_has_no_value_of_the_other_profile(cold: str) -> None:
    names = ["BUS_VOLTAGE", "HEATS_TEMP"]
    with st.open(cold) as bus:
        with pytest.raises(motorlink.ImplausibleValueError, match=MESSAGE) as wrong:
            bus.sample(names, rate=100, seconds=0.1, on_error="skip")
        check(wrong.value)
        assert len(wrong.value.samples) == 0
        raw = bus.sample(names, rate=100, seconds=0.1, raw=True)
        assert set(raw["HEATS_TEMP"]) == {65526}


def test_asyncio_returns_no_value_of_the_other_profile(cold: str) -> None:
    async def main() -> None:
        async with aio.st.open(cold) as bus:
            with pytest.raises(motorlink.ImplausibleValueError) as wrong:
                await bus.motor(1).get("HEATS_TEMP")
            check(wrong.value)
            assert await bus.motor(1).get("HEATS_TEMP", raw=True) == 65526
            with pytest.raises(motorlink.ImplausibleValueError, match=MESSAGE) as wrong:
                await bus.sample(["HEATS_TEMP"], rate=100, seconds=0.1)
            check(wrong.value)

    asyncio.run(main())


def test_a_decoded_reply_has_no_value_of_the_other_profile() -> None:
    reply = bytes.fromhex("f002f6ffe9")
    with pytest.raises(motorlink.ImplausibleValueError, match="^HEATS_TEMP is 65526 °C") as wrong:
        st.Request.get_register("HEATS_TEMP").decode_reply(reply)
    assert (wrong.value.port, wrong.value.motor, wrong.value.digits) == (None, None, 65526)
    with pytest.raises(motorlink.ImplausibleValueError):
        st.Request.get_segment(0, ["HEATS_TEMP"]).decode_reply(reply)
    right = st.Request.get_register("HEATS_TEMP", profile="mcsdk-5.4")
    assert right.decode_reply(reply) == -10
