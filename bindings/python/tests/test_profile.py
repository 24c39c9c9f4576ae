"""Values of a drive that follows another profile than the client."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

import motorlink
from motorlink import aio, st

COLD = 'profile = "mcsdk-5.4"\n[[st.motor]]\nplant.heat.ambient = -10.0\n'
READ = {"HEATS_TEMP": 65526, "FLUXWK_BUS": 985}
MESSAGE = "sim:.*: motor 1: HEATS_TEMP is 65526 °C in profile spec, .* -10 °C in profile mcsdk-5.4"


@pytest.fixture
def cold(tmp_path: Path) -> str:
    """The port of a drive of ``mcsdk-5.4`` at -10 °C."""
    config = tmp_path / "cold.toml"
    config.write_text(COLD)
    return f"sim:{config}"


def check(error: motorlink.ImplausibleValueError, register: str = "HEATS_TEMP") -> None:
    assert (error.motor, error.register, error.digits) == (1, register, READ[register])
    assert error.profile == "mcsdk-5.4" and error.port is not None


def test_a_value_that_is_plausible_in_the_other_profile_only_raises(cold: str) -> None:
    with st.open(cold) as bus:
        motor = bus.motor(1)
        for name, digits in READ.items():
            with pytest.raises(motorlink.ImplausibleValueError) as wrong:
                motor.get(name)
            check(wrong.value, name)
            assert motor.get(name, raw=True) == digits
        with pytest.raises(motorlink.ImplausibleValueError, match=MESSAGE):
            motor.registers["HEATS_TEMP"]
        with pytest.raises(motorlink.ImplausibleValueError):
            motor.registers.HEATS_TEMP  # noqa: B018
        with pytest.raises(motorlink.ImplausibleValueError):
            motor.registers.get_all()
        assert motor.get("BUS_VOLTAGE") == 325 and motor.status() == "IDLE"
        with pytest.raises(motorlink.InvalidValueError, match="0 to 100 %"):
            motor.set("FLUXWK_BUS", 985)
        motor.set("FLUXWK_BUS", 900, raw=True)
        assert motor.get("FLUXWK_BUS", raw=True) == 900
    with st.open(cold, profile="mcsdk-5.4") as bus:
        assert bus.motor(1).get("HEATS_TEMP") == -10
        assert bus.motor(1).get("FLUXWK_BUS") == 98.5


@pytest.mark.parametrize("on_error", ["raise", "skip"])
def test_a_sample_has_no_value_of_the_other_profile(cold: str, on_error: str) -> None:
    names = ["BUS_VOLTAGE", "HEATS_TEMP"]
    with st.open(cold) as bus:
        with pytest.raises(motorlink.ImplausibleValueError, match=MESSAGE) as wrong:
            bus.sample(names, rate=100, seconds=0.1, on_error=on_error)
        check(wrong.value)
        assert len(wrong.value.samples) == 0
        with pytest.raises(motorlink.ImplausibleValueError):
            next(bus.samples(names, rate=100, on_error=on_error))
        raw = bus.sample(names, rate=100, seconds=0.1, raw=True)
        assert set(raw["HEATS_TEMP"]) == {65526}


def test_asyncio_returns_no_value_of_the_other_profile(cold: str) -> None:
    async def main() -> None:
        async with aio.st.open(cold) as bus:
            motor = bus.motor(1)
            for name, digits in READ.items():
                with pytest.raises(motorlink.ImplausibleValueError) as wrong:
                    await motor.get(name)
                check(wrong.value, name)
                assert await motor.get(name, raw=True) == digits
            with pytest.raises(motorlink.ImplausibleValueError, match=MESSAGE) as wrong:
                await bus.sample(["HEATS_TEMP"], rate=100, seconds=0.1)
            check(wrong.value)
            with pytest.raises(motorlink.ImplausibleValueError):
                async for _ in bus.samples(["HEATS_TEMP"], rate=100):
                    pass
            raw = await bus.sample(["HEATS_TEMP"], rate=100, seconds=0.1, raw=True)
            assert set(raw["HEATS_TEMP"]) == {65526}
            assert await motor.get("BUS_VOLTAGE") == 325

    asyncio.run(main())


def test_a_decoded_reply_has_no_value_of_the_other_profile() -> None:
    reply = bytes.fromhex("f002f6ffe9")
    with pytest.raises(motorlink.ImplausibleValueError, match="^HEATS_TEMP is 65526 °C") as wrong:
        st.Request.get_register("HEATS_TEMP").decode_reply(reply)
    assert (wrong.value.port, wrong.value.motor, wrong.value.digits) == (None, None, 65526)
    assert st.Request.get_register("HEATS_TEMP", raw=True).decode_reply(reply) == 65526
    segment = st.Request.get_segment(0, ["HEATS_TEMP"])
    with pytest.raises(motorlink.ImplausibleValueError):
        segment.decode_reply(reply)
    right = st.Request.get_register("HEATS_TEMP", profile="mcsdk-5.4")
    assert right.decode_reply(reply) == -10
