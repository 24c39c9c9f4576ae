"""SIGTERM and SIGHUP stop the motors of a program, and then end it as usual."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from conftest import Served, eventually
from drive import REGISTERS, START, STOP, Drive, frame
from motorlink import aio, rmd, st

SIGNALS = [signal.SIGTERM, signal.SIGHUP]

BEGIN = """
    import asyncio, signal, sys, threading, time, motorlink

    def start(bus):
        return bus.motor(1).start() if sys.argv[1] == "st" else bus.motor(1).set_speed(360)

    def ready():
        print("ready", flush=True)
"""


@contextmanager
def program(script: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A Python program that is ready. It is killed at the end if it still runs."""
    words = [sys.executable, "-c", textwrap.dedent(BEGIN) + textwrap.dedent(script), *arguments]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout and process.stdout.readline() == "ready\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def is_turning(served: Served, kind: str) -> bool:
    if kind == "st":
        return served.motor("st", 1)["status"] not in ("IDLE", "STOP", "STOP_IDLE")
    return served.motor("rmd", 1)["mode"] not in ("stopped", "off")


def port(served: Served, kind: str) -> str:
    return served.st if kind == "st" else served.can


BLOCKING = """
    bus = getattr(motorlink, sys.argv[1]).open(sys.argv[2], timeout=2.0)
    start(bus)
    ready()
    time.sleep(600)
"""

BUSY = """
    bus = getattr(motorlink, sys.argv[1]).open(sys.argv[2], timeout=2.0)
    start(bus)
    ready()
    while True:
        bus.motor(1).flags() if sys.argv[1] == "st" else bus.motor(1).motion_status()
"""

ASYNC = """
    async def main():
        async with getattr(motorlink.aio, sys.argv[1]).open(sys.argv[2], timeout=2.0) as bus:
            await start(bus)
            ready()
            while True:
                await (bus.motor(1).flags() if sys.argv[1] == "st" else bus.motor(1).motion_status())
    asyncio.run(main())
"""


@pytest.mark.parametrize(
    ("kind", "script", "number"),
    [
        ("st", BLOCKING, signal.SIGTERM),
        ("rmd", BLOCKING, signal.SIGHUP),
        ("rmd", BUSY, signal.SIGTERM),
        ("st", ASYNC, signal.SIGHUP),
        ("rmd", ASYNC, signal.SIGTERM),
    ],
    ids=["idle st", "idle rmd", "busy rmd", "asyncio st", "asyncio rmd"],
)
def test_a_signal_stops_the_motors_and_ends_the_program(
    served: Served, kind: str, script: str, number: signal.Signals
) -> None:
    with program(script, kind, port(served, kind)) as running:
        eventually(lambda: is_turning(served, kind), "a motor that turns")
        running.send_signal(number)
        assert running.wait(60) == -number
        eventually(lambda: not is_turning(served, kind), "a motor at rest")


# As if the signal came just before the wait: the handler of Python's C code has run, and nothing ends
# the wait.
JUST_BEFORE_A_WAIT = """
    bus = getattr(motorlink, sys.argv[1]).open(sys.argv[2], timeout=2.0)
    start(bus)
    ready()
    def signal_this_thread():
        sys.stdin.readline()
        signal.pthread_kill(threading.get_ident(), int(sys.argv[3]))
    threading.Thread(target=signal_this_thread, daemon=True).start()
    time.sleep(600)
"""


def test_a_signal_just_before_a_wait_stops_the_motors(served: Served) -> None:
    number = signal.SIGTERM
    with program(JUST_BEFORE_A_WAIT, "st", served.st, str(int(number))) as running:
        eventually(lambda: is_turning(served, "st"), "a motor that turns")
        running.communicate("\n", timeout=60)
        assert running.returncode == -number
        eventually(lambda: not is_turning(served, "st"), "a motor at rest")


FORKED = """
    import os
    bus = motorlink.st.open(sys.argv[2])
    start(bus)
    child = os.fork()
    if not child:
        signal.signal(signal.SIGTERM, lambda *_: os._exit(7))
        print("ready", flush=True)
        time.sleep(600)
    sys.stdin.readline()
    os.kill(child, signal.SIGTERM)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    print("parent", bus.motor(1).get("STATUS"), flush=True)
    time.sleep(600)
"""


def test_the_signal_of_a_forked_program_is_not_its_parents(served: Served) -> None:
    with program(FORKED, "st", served.st) as running:
        assert running.stdin and running.stdout
        running.stdin.write("\n")
        running.stdin.flush()
        assert running.stdout.readline().startswith("parent")
        running.send_signal(signal.SIGTERM)
        assert running.wait(60) == -signal.SIGTERM
        eventually(lambda: not is_turning(served, "st"), "a motor at rest")


DEAF = """
    bus = motorlink.st.open(sys.argv[2], timeout=30.0)
    bus.motor(1).start()
    ready()
    bus.motor(1).get("SPEED_REF")
"""


def test_a_signal_stops_a_motor_during_a_wait_for_a_reply(tmp_path: Path) -> None:
    drive = Drive(tmp_path / "st0", 3)
    drive.is_deaf_to = REGISTERS["SPEED_REF"]
    try:
        with program(DEAF, "st", str(drive.path)) as running:
            eventually(lambda: drive.unanswered == 1, "a request without an answer")
            running.send_signal(signal.SIGTERM)
            assert running.wait(60) == -signal.SIGTERM
        # One at once, and one or more on the recovered line, until it is confirmed.
        assert drive.executed[:3] == [(1, START), (1, STOP), (1, STOP)]
        assert set(drive.executed[1:]) == {(1, STOP)}
    finally:
        drive.unplug()


CLOSING = """
    bus = motorlink.st.open(sys.argv[2], timeout=0.2)
    try:
        bus.motor(1).start()
    except motorlink.ReplyTimeoutError:
        pass
    threading.Thread(target=bus.close).start()
    ready()
    time.sleep(600)
"""

CLOSING_ASYNC = """
    async def main():
        bus = await motorlink.aio.st.open(sys.argv[2], timeout=0.2)
        try:
            await bus.motor(1).start()
        except motorlink.ReplyTimeoutError:
            pass
        ready()
        await bus.close()
    asyncio.run(main())
"""


@pytest.mark.parametrize("script", [CLOSING, CLOSING_ASYNC], ids=["blocking", "asyncio"])
def test_a_signal_lets_a_close_in_another_thread_finish(script: str) -> None:
    ours, theirs = os.openpty()
    stop = frame(0x23, bytes([STOP]))
    heard = b""
    try:
        with program(script, "st", os.ttyname(theirs)) as running:
            while stop not in heard:
                heard += os.read(ours, 4096)
            running.send_signal(signal.SIGTERM)
            assert running.wait(60) == -signal.SIGTERM
        os.set_blocking(ours, False)
        heard += os.read(ours, 65536)
        # The stop is sent four times to a silent drive.
        assert heard.count(stop) >= 4
    finally:
        os.close(ours)
        os.close(theirs)


OPTED_OUT = """
    bus = motorlink.st.open(sys.argv[2], stop_on_signals=False)
    start(bus)
    ready()
    time.sleep(600)
"""


def test_a_client_that_opted_out_has_no_handler(served: Served) -> None:
    with program(OPTED_OUT, "st", served.st) as running:
        eventually(lambda: served.motor("st", 1)["status"] == "RUN", "a motor in RUN")
        running.send_signal(signal.SIGTERM)
        assert running.wait(60) == -signal.SIGTERM
        assert is_turning(served, "st")


BOTH_THREADS = """
    first = motorlink.st.open("sim:")
    opened = threading.Event()
    def work():
        global bus
        bus = motorlink.st.open(sys.argv[2])
        start(bus)
        opened.set()
    threading.Thread(target=work).start()
    opened.wait()
    ready()
    time.sleep(600)
"""


def test_handlers_of_the_main_thread_stop_motors_of_other_threads(served: Served) -> None:
    with program(BOTH_THREADS, "st", served.st) as running:
        eventually(lambda: served.motor("st", 1)["status"] == "RUN", "a motor in RUN")
        running.send_signal(signal.SIGTERM)
        assert running.wait(60) == -signal.SIGTERM
        eventually(lambda: not is_turning(served, "st"), "a motor at rest")


def handlers() -> list[Any]:
    return [signal.getsignal(number) for number in SIGNALS]


@pytest.fixture
def default() -> Iterator[None]:
    before = [signal.signal(number, signal.SIG_DFL) for number in SIGNALS]
    yield
    for number, handler in zip(SIGNALS, before):
        signal.signal(number, handler)


@pytest.mark.usefixtures("default")
def test_the_last_close_restores_the_default_action() -> None:
    default = [signal.SIG_DFL, signal.SIG_DFL]
    with st.open("sim:"):
        replaced = handlers()
        assert signal.SIG_DFL not in replaced
        with rmd.open("sim:"):
            assert handlers() == replaced
        assert handlers() == replaced
    assert handlers() == default
    for opened in (st.open("sim:", stop_on_signals=False), rmd.open("sim:", on_close="nothing")):
        with opened:
            assert handlers() == default
    # The close in another thread cannot restore it. The next close does.
    bus = st.open("sim:")
    thread = threading.Thread(target=bus.close)
    thread.start()
    thread.join()
    with st.open("sim:"):
        assert handlers() == replaced
    assert handlers() == default


@pytest.mark.usefixtures("default")
def test_asyncio_restores_the_default_action_too() -> None:
    async def main() -> None:
        async with aio.st.open("sim:"), aio.rmd.open("sim:"):
            assert signal.SIG_DFL not in handlers()
        assert handlers() == [signal.SIG_DFL, signal.SIG_DFL]

    asyncio.run(main())


@pytest.mark.usefixtures("default")
def test_other_handlers_are_kept() -> None:
    def own(number: int, frame: FrameType | None) -> None: ...

    signal.signal(signal.SIGTERM, own)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with st.open("sim:"):
        assert handlers() == [own, signal.SIG_IGN]
    assert handlers() == [own, signal.SIG_IGN]
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with st.open("sim:"):
        signal.signal(signal.SIGTERM, own)
    assert handlers() == [own, signal.SIG_IGN]
