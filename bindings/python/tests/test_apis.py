"""The blocking and the asyncio API have the same methods, arguments and docstrings, and their own types."""

from __future__ import annotations

import asyncio
import inspect
import threading
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any

import pytest

import motorlink
from motorlink import aio, rmd, st
from motorlink._apis import Awaited, Blocking, Exchanges, both_apis

if TYPE_CHECKING:
    from typing_extensions import assert_type

PAIRS = [
    (st.Client, aio.st.Client),
    (st.Motor, aio.st.Motor),
    (rmd.Client, aio.rmd.Client),
    (rmd.Motor, aio.rmd.Motor),
]


def public(kind: type) -> dict[str, Any]:
    """The public members of a class."""
    members = inspect.getmembers(kind)
    return {name: member for name, member in members if not name.startswith("_")}


@pytest.mark.parametrize(("blocking", "awaited"), PAIRS)
def test_both_apis_have_the_same_methods(blocking: type, awaited: type) -> None:
    ours, theirs = public(blocking), public(awaited)
    assert set(ours) == set(theirs)
    coroutines = 0
    for name, method in theirs.items():
        if not inspect.isfunction(method):
            assert type(ours[name]) is type(method), name
            continue
        assert inspect.signature(ours[name]) == inspect.signature(method), name
        assert inspect.getdoc(ours[name]) == inspect.getdoc(method), name
        assert not inspect.iscoroutinefunction(ours[name]), name
        coroutines += inspect.iscoroutinefunction(method)
    assert coroutines >= 6


@pytest.mark.parametrize(("blocking", "awaited"), [(st, aio.st), (rmd, aio.rmd)])
def test_both_apis_open_with_the_same_arguments(blocking: Any, awaited: Any) -> None:
    ours, theirs = inspect.signature(blocking.open), inspect.signature(awaited.open)
    assert ours.parameters == theirs.parameters
    assert (ours.return_annotation, theirs.return_annotation) == ("Client", "Opening[Client]")
    assert inspect.getdoc(blocking.open) == inspect.getdoc(awaited.open)
    assert (blocking.open.__name__, blocking.open.__module__) == ("open", blocking.__name__)


class Shared:
    """A definition that handles errors of its exchanges."""

    def __init__(self) -> None:
        self.tried = 0

    @both_apis
    def stubborn(self, fails: int) -> Exchanges[str]:
        """Tries until an exchange succeeds."""
        while True:
            try:
                answer: str = yield self.exchange(fails)
            except ValueError:
                self.tried += 1
            else:
                return answer

    def exchange(self, fails: int) -> Any:
        raise NotImplementedError


class BlockingOne(Blocking, Shared):
    def exchange(self, fails: int) -> str:
        if self.tried < fails:
            raise ValueError
        return "done"


class AwaitedOne(Awaited, Shared):
    async def exchange(self, fails: int) -> str:
        await asyncio.sleep(0)
        if self.tried < fails:
            raise ValueError
        return "done"


def test_a_definition_can_handle_errors_of_an_exchange() -> None:
    assert BlockingOne().stubborn(3) == "done"
    assert asyncio.run(AwaitedOne().stubborn(3)) == "done"


def test_cancellation_ends_a_definition() -> None:
    async def main() -> None:
        task = asyncio.ensure_future(AwaitedOne().stubborn(10**9))
        await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(main())


def test_a_method_of_a_subclass_is_kept() -> None:
    class Quiet(BlockingOne):
        def stubborn(self, fails: int) -> str:
            return "replaced"

    class Quieter(Quiet):
        pass

    assert Quieter().stubborn(1) == "replaced"


def test_a_read_cannot_be_assigned() -> None:
    with rmd.open("sim:") as bus:
        with pytest.raises(AttributeError, match="read-only"):
            bus.motor(1).pid = bus.motor(1).pid()  # type: ignore[misc, assignment]


def in_a_thread(method: Callable[[], object]) -> None:
    thread = threading.Thread(target=method)
    thread.start()
    thread.join()


def test_a_read_without_brackets_raises() -> None:
    """`while motor.status != "RUN":` would never end, and the motor would turn."""
    with st.open("sim:") as drive, rmd.open("sim:") as bus:
        reads: list[Any] = [drive.motor(1).status, drive.motor(1).flags, drive.board_info]
        reads += [bus.motor(1).multi_turn_angle, bus.motor(1).status, bus.motor(1).motion_status]
        for read in reads:
            for taken in (
                lambda read: read == "RUN",
                lambda read: read != 90,
                lambda read: not read,
                lambda read: f"{read}",
                lambda read: read > 1,
                lambda read: 90 - read,
                lambda read: read[0],
                float,
            ):
                with pytest.raises(TypeError, match="is a method: write"):
                    taken(read)
            with pytest.raises(AttributeError, match="is a method: write `.*[(][)].speed_dps`"):
                read.speed_dps
            with pytest.raises(TypeError) as unhashable:
                {read}
            assert "_Uncalled" not in str(unhashable.value)
            assert callable(read) and read.__doc__ and read() is not None
            in_a_thread(read)
        drive.motor(1).start()
        in_a_thread(drive.motor(1).stop)
        assert drive.motor(1).status() != "RUN"


def test_a_function_in_place_of_a_request_is_named() -> None:
    with st.open("sim:") as drive, rmd.open("sim:") as bus:
        cases: list[tuple[Callable[[], object], str]] = [
            (lambda: bus.cycle({1: rmd.read_status}), "`read_status` is a function that was not"),  # type: ignore[dict-item]
            (lambda: bus.cycle({1: bus.motor(1).status}), "`status` is a function that was not"),  # type: ignore[dict-item]
            (lambda: bus.exchange(1, rmd.Request.off), "`off` is a function that was not"),  # type: ignore[arg-type]
            (lambda: bus.exchange(1, b"\x9a"), "such as `rmd.read_status"),  # type: ignore[arg-type]
            (lambda: drive.exchange(1, st.Request.status), "such as `Request.status"),  # type: ignore[arg-type]
            (lambda: bus.motor(1).set_speed(bus.motor(2).status), "`status` is a method: write"),  # type: ignore[arg-type]
        ]
        for mistake, message in cases:
            with pytest.raises(TypeError, match=message):
                mistake()


def types_of_the_blocking_api(bus: st.Client, motors: rmd.Client) -> None:
    """Checked by mypy, not run."""
    assert_type(st.open("sim:"), st.Client)
    assert_type(bus.motor(1), st.Motor)
    assert_type(bus.motor(1).client, st.Client)
    assert_type(bus.motor(1).get("STATUS"), float)
    assert_type(bus.motor(1).status(), st.Status)
    assert_type(motors.motor(1).pid(), rmd.Pid)
    assert_type(motors.motor(1).set_speed(1), rmd.MotionStatus)
    bus.motor(1).set_ramp("fast", 1)  # type: ignore[arg-type]
    bus.motor(1).set_ramp(1)  # type: ignore[call-arg]
    st.open("sim:", profil="spec")  # type: ignore[call-arg]


async def types_of_asyncio(bus: aio.st.Client, motors: aio.rmd.Client) -> None:
    """Checked by mypy, not run."""
    assert_type(await aio.st.open("sim:"), aio.st.Client)
    assert_type(bus.motor(1).client, aio.st.Client)
    assert_type(await bus.motor(1).get("STATUS"), float)
    assert_type(await motors.motor(1).pid(), rmd.Pid)
    status: Coroutine[Any, Any, st.Status] = bus.motor(1).status()
    assert_type(await status, st.Status)
    bus.motor(1).stop()  # type: ignore[unused-coroutine]
    aio.st.open(motorlink.sim.Bench())  # type: ignore[arg-type]
