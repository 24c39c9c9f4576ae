"""Settings as text: dump, diff and restore of both protocols and both APIs, also when they are interrupted."""

from __future__ import annotations

import asyncio
import re
import select
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import motorlink
from conftest import PATIENT, Served
from motorlink import SettingDifference, SettingsDump, aio, errors, rmd, sim, st

#: Settings of each protocol, in the order of a file, with new values.
NEW = {
    "st": {"SPEED_KP": 950, "TORQUE_KI": 6, "REVUP_0_TORQUE": 100},
    "rmd": {"speed_kp": 95, "acceleration": 700, "encoder_offset": 5},
}
#: The codes of requests that write.
WRITES = {"st": ("SET_REG", "SET_REVUP_DATA"), "rmd": (0x31, 0x32, 0x34, 0x91)}
#: The steps are the same for both protocols and both APIs. Their exchanges are not.
EACH = pytest.mark.parametrize(("protocol", "api"), [("st", "asyncio"), ("rmd", "blocking")])

#: What happens to an exchange: its number among the writes, or 0 for another request.
Meddling = Callable[[int], None]


def changed(text: str, values: dict[str, int]) -> str:
    """The text of a file with other values."""
    for name, value in values.items():
        text, count = re.subn(rf"^{name} = \S+", f"{name} = {value}", text, flags=re.M)
        assert count == 1, name
    return text


def reply_at_once(steps: Any) -> None:
    """Gives each reply to the client in the same step of the event loop as its request."""
    take = steps.take

    def take_the_reply() -> None:
        take()
        select.select([steps._watched], [], [], PATIENT)
        take()

    steps.take = take_the_reply


class Motor:
    """Motor 1 of served drives, through either API: one connection for each call."""

    def __init__(self, served: Served, protocol: str, api: str):
        self.protocol, self.api = protocol, api
        self.port = served.st if protocol == "st" else served.can
        self.options: dict[str, Any] = {} if protocol == "st" else {"timeout": PATIENT}
        self.writes = 0
        self.replies_at_once = False

    def do(self, act: Callable[[Any], Any], meddling: Meddling | None = None) -> Any:
        """The result of `act`, which gets the motor's settings."""
        self.writes = 0
        if self.api == "blocking":
            blocking: Any = {"st": st, "rmd": rmd}[self.protocol]
            with blocking.open(self.port, **self.options) as client:
                self.meddle(client, meddling)
                return act(client.motor(1).settings)
        return asyncio.run(self.awaited(act, meddling))

    async def awaited(self, act: Callable[[Any], Any], meddling: Meddling | None) -> Any:
        awaited: Any = {"st": aio.st, "rmd": aio.rmd}[self.protocol]
        async with awaited.open(self.port, **self.options) as client:
            self.meddle(client, meddling)
            if self.replies_at_once:
                reply_at_once(client._steps)
            return await act(client.motor(1).settings)

    def meddle(self, client: Any, meddling: Meddling | None) -> None:
        """Calls `meddling` after each exchange."""
        if meddling is None:
            return
        exchange = client._exchange

        def number(request: Any) -> int:
            is_write = request.code in WRITES[self.protocol]
            self.writes += is_write
            return self.writes if is_write else 0

        def blocking(motor: int, request: Any) -> Any:
            reply = exchange(motor, request)
            meddling(number(request))
            return reply

        async def awaited(motor: int, request: Any) -> Any:
            reply = await exchange(motor, request)
            meddling(number(request))
            return reply

        client._exchange = blocking if self.api == "blocking" else awaited

    def dump(self) -> SettingsDump:
        dump: SettingsDump = self.do(lambda settings: settings.dump())
        return dump

    def restore(self, text: Any, meddling: Meddling | None = None, **options: bool) -> Any:
        return self.do(lambda settings: settings.restore(text, **options), meddling)


@pytest.fixture
def motor(served: Served) -> Callable[[str, str], Motor]:
    return lambda protocol, api: Motor(served, protocol, api)


MotorOf = Callable[[str, str], Motor]


@EACH
def test_a_dump_is_the_file_of_the_command(
    motor: MotorOf, command: str, protocol: str, api: str
) -> None:
    one = motor(protocol, api)
    dump = one.dump()
    words = [command, protocol, "-p", one.port, "--timeout", f"{PATIENT}s", "dump"]
    text = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout
    assert str(dump) == text
    assert dict(dump) == {name: dump[name] for name in dump} and len(dump) > 5
    for name, value in dump.items():
        unit = dump.units[name]
        line = next(line for line in text.splitlines() if line.startswith(f"{name} = "))
        assert line.split()[2] == str(value) and f"# {unit}" in line + "# "
    assert ("FLUXWK_BUS" in (*dump, *dump.absent)) == (protocol == "st")


@EACH
def test_a_restore_returns_what_it_changed(
    motor: MotorOf, tmp_path: Path, protocol: str, api: str
) -> None:
    one, new = motor(protocol, api), NEW[protocol]
    before = one.dump()
    text = changed(str(before), new)
    expected = [SettingDifference(n, before[n], new[n], before.units[n]) for n in new]
    assert one.do(lambda settings: settings.diff(text)) == expected
    assert one.restore(text, dry_run=True, to_rom=True) == expected
    assert one.dump() == before
    file = tmp_path / "motor1.toml"
    file.write_text(text)
    assert one.restore(file, to_rom=True) == expected
    assert one.dump() == {**before, **new}
    assert one.do(lambda settings: settings.diff(file)) == []
    assert one.restore(file) == []
    assert [change.name for change in one.restore(before, to_rom=True)] == [*new]
    assert one.dump() == before


def test_the_rom_is_written_on_request_only(motor: MotorOf) -> None:
    one = motor("rmd", "blocking")
    before = one.dump()
    text = changed(str(before), {"speed_kp": 95, "encoder_offset": 5})
    for dry_run in (True, False):
        with pytest.raises(motorlink.SettingsError, match="each write wears the ROM") as raised:
            one.restore(text, dry_run=dry_run)
        assert "nothing was written; to_rom=True allows it" in str(raised.value)
        assert (raised.value.port, raised.value.motor) == (one.port, 1)
        assert raised.value.changed == raised.value.unknown == ()
    assert one.dump() == before


def test_a_motor_that_turns_is_refused() -> None:
    with st.open(sim.Bench()) as client:
        turning = client.motor(1)
        text = changed(str(turning.settings.dump()), {"SPEED_KP": 950})
        turning.start()
        with pytest.raises(motorlink.SettingsError, match="nothing was written") as raised:
            turning.settings.restore(text)
        assert str(raised.value).endswith("stop it first, or allow it with running=True")
        assert len(turning.settings.restore(text, running=True)) == 1
        assert turning.settings.diff(text) == []


def test_limits_apply_before_the_first_write() -> None:
    for api in ("blocking", "asyncio"):
        text = "[st]\nprofile = 'spec'\n[st.settings]\nSPEED_KP = 5\nREVUP_1_SPEED = 1500\n"
        with pytest.raises(motorlink.SettingsError, match="1200 rpm.*nothing was written") as raised:
            if api == "blocking":
                with st.open("sim:", speed_limit_rpm=1200) as client:
                    client.motor(1).settings.restore(text)
            else:

                async def main() -> None:
                    async with aio.st.open("sim:", speed_limit_rpm=1200) as client:
                        await client.motor(1).settings.restore(text)

                asyncio.run(main())
        assert isinstance(raised.value.__cause__, errors.InvalidValueError)


@pytest.mark.parametrize(
    ("settings", "kind", "said"),
    [
        ("[st]\nprofile = 'spec'\n[st.settings]\nSPEED_KPP = 1\n", ValueError, "line 4: .*SPEED_KP"),
        ("motor1.toml", ValueError, r"pathlib.Path\('motor1.toml'\)"),
        (Path("/nothing/there.toml"), FileNotFoundError, "there.toml"),
        (Path("/dev/zero"), ValueError, "1 MiB"),
        (7, TypeError, "pathlib.Path"),
    ],
)
def test_what_is_not_for_this_motor_is_refused(
    settings: Any, kind: type[Exception], said: str
) -> None:
    with st.open("sim:") as client:
        before = client.motor(1).settings.dump()
        with pytest.raises(kind, match=said):
            client.motor(1).settings.restore(settings)
        assert client.motor(1).settings.dump() == before


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "motor1.toml"
    file.write_bytes(b"\xff\xfe")
    with rmd.open("sim:") as client, pytest.raises(motorlink.InvalidValueError, match=str(file)):
        client.motor(1).settings.diff(file)


def test_a_lost_line_leaves_the_values_that_the_exception_has(motor: MotorOf) -> None:
    one, new = motor("st", "blocking"), NEW["st"]
    before = one.dump()
    lost: list[int] = []

    def cut(write: int) -> None:
        lost.extend([write] * (write == 2))
        if lost:
            raise motorlink.LinkError("cut")

    with pytest.raises(motorlink.SettingsError, match="; all others are as before") as raised:
        one.restore(changed(str(before), new), cut)
    assert isinstance(raised.value.__cause__, motorlink.LinkError)
    assert "`motor.settings.diff` shows what differs" in str(raised.value)
    first, second = (*new,)[:2]
    assert (raised.value.changed, raised.value.unknown) == ((first,), (second,))
    assert one.dump()[first] == new[first]


def test_a_write_that_is_carried_out_and_refused_is_rolled_back(motor: MotorOf) -> None:
    one, new = motor("rmd", "asyncio"), NEW["rmd"]
    before = one.dump()

    def refuse(write: int) -> None:
        if write == 2:
            raise motorlink.RefusedError("no", code=4)

    with pytest.raises(motorlink.SettingsError, match="no; rolled back to the old values") as raised:
        one.restore(changed(str(before), new), refuse, to_rom=True)
    assert raised.value.rolled_back == (*new,)[:2]
    assert raised.value.unknown == ()
    assert one.dump() == before


@EACH
def test_an_interruption_at_any_exchange_puts_the_old_values_back(
    motor: MotorOf, protocol: str, api: str
) -> None:
    one, new = motor(protocol, api), NEW[protocol]
    before = one.dump()
    text = changed(str(before), new)
    ended, at = 0, 0
    while ended == at:
        at += 1
        exchanges = 0
        tasks: list[asyncio.Task[Any]] = []

        def interrupt(write: int, at: int = at, tasks: Any = tasks) -> None:
            nonlocal exchanges
            exchanges += bool(exchanges or write)
            if exchanges == at and api == "blocking":
                raise KeyboardInterrupt
            if exchanges == at:
                tasks[0].cancel()

        async def cancelled(settings: Any, tasks: Any = tasks) -> None:
            tasks.append(asyncio.current_task())
            await settings.restore(text, to_rom=True)

        def blocking(settings: Any) -> None:
            settings.restore(text, to_rom=True)

        try:
            one.do(blocking if api == "blocking" else cancelled, interrupt)
        except (KeyboardInterrupt, asyncio.CancelledError) as error:
            ended += 1
            state = error.__cause__
        else:
            state = None
        # A cancellation during the last exchange comes when the restore is complete.
        kept = {name: float(value) for name, value in new.items()}
        if state is not None:
            assert isinstance(state, motorlink.SettingsError)
            assert not state.unknown and not state.changed
            kept = {name: before[name] for name in new}
        real = one.dump()
        assert {name: real[name] for name in new} == kept, f"interrupted at exchange {at}"
        if real != before:
            one.restore(before, to_rom=True)
    # Each setting has a write and a read.
    assert ended >= 2 * len(new)


def test_a_second_ctrl_c_ends_the_roll_back(motor: MotorOf) -> None:
    one, new = motor("rmd", "blocking"), NEW["rmd"]
    before = one.dump()

    def interrupt(write: int) -> None:
        if write >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as raised:
        one.restore(changed(str(before), new), interrupt, to_rom=True)
    state = raised.value.__cause__
    assert isinstance(state, motorlink.SettingsError)
    first, second = (*new,)[:2]
    assert (state.changed, state.unknown) == ((first,), (second,))
    assert one.dump()[first] == new[first]


def test_a_cancelled_restore_puts_the_old_values_back_also_if_replies_come_at_once(motor: MotorOf) -> None:
    one, new = motor("st", "asyncio"), NEW["st"]
    before = one.dump()
    tasks: list[asyncio.Task[Any]] = []

    def cancel(write: int) -> None:
        if write == 2:
            tasks[0].cancel()

    async def main(settings: Any) -> BaseException | None:
        tasks.append(asyncio.ensure_future(settings.restore(changed(str(before), new), to_rom=True)))
        await asyncio.wait(tasks)
        assert tasks[0].cancelled()
        try:
            await tasks[0]
        except asyncio.CancelledError as error:
            return error.__cause__
        return None

    one.replies_at_once = True
    state = one.do(main, cancel)
    one.replies_at_once = False
    assert one.dump() == before
    assert isinstance(state, motorlink.SettingsError)
    assert state.rolled_back == (*new,)[:2]


def test_one_motor_has_one_restore_at_a_time(motor: MotorOf) -> None:
    one, new = motor("rmd", "asyncio"), NEW["rmd"]
    before = one.dump()
    text = changed(str(before), new)

    async def main(settings: Any) -> list[Any]:
        both = [settings.restore(text, to_rom=True) for _ in range(2)]
        return await asyncio.gather(*both, return_exceptions=True)

    first, second = one.do(main)
    assert [change.name for change in first] == [*new]
    assert isinstance(second, motorlink.InvalidValueError)
    assert "another restore of motor 1 is in progress; nothing was sent" in str(second)
    assert [change.name for change in one.restore(before, to_rom=True)] == [*new]


def test_a_closed_client_restores_nothing() -> None:
    client = st.open("sim:")
    settings = client.motor(1).settings
    text = str(settings.dump())
    client.close()
    for act in (settings.dump, lambda: settings.diff(text), lambda: settings.restore(text)):
        with pytest.raises((motorlink.ClosedError, motorlink.SettingsError), match="was closed"):
            act()


def test_other_tasks_use_the_line_during_a_restore(motor: MotorOf) -> None:
    one = motor("st", "asyncio")
    text = changed(str(one.dump()), NEW["st"])

    async def main(settings: Any) -> int:
        restoring = asyncio.ensure_future(settings.restore(text))
        reads = 0
        while not restoring.done():
            await settings._motor.get("BUS_VOLTAGE")
            reads += 1
        assert len(await restoring) == 3
        return reads

    assert one.do(main) > 3
