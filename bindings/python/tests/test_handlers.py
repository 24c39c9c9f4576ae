"""Signal handlers that use the client which the interrupted code waits for."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from conftest import Served, eventually
from drive import REGISTERS, START, STOP, Drive

#: Repetitions of a case that once hung in most runs.
RUNS = 2

#: Time limit of a program that waits for nothing, s.
PATIENT = 60

BEGIN = """
    import os, random, signal, sys, threading, time, motorlink

    #: Nested handlers under way.
    within = [0]

    def on_signal(act):
        def handle(*_):
            within[0] += 1
            try:
                act()
            finally:
                within[0] -= 1
        signal.signal(signal.SIGUSR1, handle)

    def signal_later(wait=0.0):
        threading.Timer(wait, os.kill, (os.getpid(), signal.SIGUSR1)).start()

    def signals_until(done):
        # From another thread, at random instants, also during handlers. At most three are nested,
        # because a busy machine would never leave them.
        def shoot():
            while not done():
                time.sleep(random.uniform(0.0, 0.02))
                if within[0] < 3:
                    os.kill(os.getpid(), signal.SIGUSR1)
        thread = threading.Thread(target=shoot)
        thread.start()
        return thread

    def waits(wait):
        try:
            wait()
            print("went on", flush=True)
        except motorlink.MotorlinkError as error:
            print(type(error).__name__, "aborted this exchange" in str(error), flush=True)
"""


def program(script: str, *arguments: str) -> subprocess.Popen[str]:
    """A Python program in this folder."""
    words = [sys.executable, "-c", textwrap.dedent(BEGIN) + textwrap.dedent(script), *arguments]
    folder = Path(__file__).parent
    return subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder
    )


def ends(process: subprocess.Popen[str]) -> list[str]:
    """The output of a program up to its end. A program that does not end fails the test."""
    try:
        out, err = process.communicate(timeout=PATIENT)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise AssertionError("it hangs") from None
    assert process.returncode == 0, err
    return out.splitlines()


STOP_WHILE_DEAF = """
    with motorlink.st.open(sys.argv[1], timeout=30.0, on_close="nothing") as bus:
        motor = bus.motor(1)
        motor.start()
        on_signal(motor.stop)
        signal_later(0.1)
        waits(lambda: motor.get("SPEED_REF"))
        print(bus.moving)
"""


def test_a_handler_stops_a_motor_during_a_wait_for_a_reply(tmp_path: Path) -> None:
    drive = Drive(tmp_path / "st0", 3)
    drive.is_deaf_to = REGISTERS["SPEED_REF"]
    try:
        for _ in range(RUNS):
            drive.executed.clear()
            assert ends(program(STOP_WHILE_DEAF, str(drive.path))) == ["PortError True", "[]"]
            # At once, and again when the line is resynchronised.
            assert drive.executed == [(1, START), (1, STOP), (1, STOP)]
    finally:
        drive.unplug()


HANDLER_AT_RANDOM = """
    kind, port = sys.argv[1:]
    done = []
    def stop():
        # A nested handler abandons the exchange of this one, also during `sample`.
        try:
            bus.motor(1).stop()
        except motorlink.PortError as error:
            assert "aborted this exchange" in str(error), error
        done.append(True)
    on_signal(stop)
    going = True
    def ask():
        bus.motor(1).get("STATUS") if kind == "st" else bus.motor(1).motion_status()
    with getattr(motorlink, kind).open(port, timeout=2.0) as bus:
        ask()
        thread = signals_until(lambda: not going)
        while len(done) < 20:
            try:
                ask()
            except motorlink.PortError as error:
                assert "aborted this exchange" in str(error), error
        data = bus.sample(["SPEED_MEAS" if kind == "st" else "iq_amps"], rate=200, seconds=0.3)
        going = False
        thread.join()
    print(len(data) > 0)
"""


@pytest.mark.parametrize("kind", ["st", "rmd"])
def test_handlers_stop_motors_at_any_instant(served: Served, kind: str) -> None:
    port = served.st if kind == "st" else served.can
    assert ends(program(HANDLER_AT_RANDOM, kind, port)) == ["True"]


STOP_ON_PYTHON_CAN = """
    import can
    from test_can import Motor
    other = Motor("handlers", 7)
    with can.Bus("handlers", interface="virtual") as line:
        with motorlink.rmd.open(motorlink.can.from_python_can(line), timeout=2.0) as bus:
            motor = bus.motor(7)
            done = []
            def stop():
                motor.stop()
                done.append(True)
            on_signal(stop)
            # The first exchange with a motor takes long, and most handlers would run during it.
            motor.motion_status()
            thread = signals_until(lambda: len(done) >= 10)
            while thread.is_alive():
                try:
                    motor.set_speed(100)
                    motor.motion_status()
                except motorlink.PortError as error:
                    assert "aborted this exchange" in str(error), error
            print(0x81 in other.heard)
    other.end()
"""


def test_a_handler_stops_a_motor_on_a_bus_of_python_can() -> None:
    for _ in range(RUNS):
        assert ends(program(STOP_ON_PYTHON_CAN)) == ["True"]


ASYNCIO = """
    import asyncio
    async def main():
        async with motorlink.aio.st.open(sys.argv[1], timeout=30.0) as bus:
            motor = bus.motor(1)
            await motor.start()
            loop = asyncio.get_running_loop()
            waiting = loop.create_task(motor.get("SPEED_REF"))
            loop.add_signal_handler(signal.SIGUSR1, waiting.cancel)
            signal_later(0.1)
            await asyncio.wait([waiting])
            await motor.stop()
            print(waiting.cancelled(), bus.moving)
    asyncio.run(main())
"""


def test_a_handler_of_an_event_loop_cancels_a_wait_and_stops_the_motor(tmp_path: Path) -> None:
    drive = Drive(tmp_path / "st0", 3)
    drive.is_deaf_to = REGISTERS["SPEED_REF"]
    try:
        assert ends(program(ASYNCIO, str(drive.path))) == ["True []"]
        assert drive.executed == [(1, START), (1, STOP), (1, STOP)]
    finally:
        drive.unplug()


ASYNC_ON_PYTHON_CAN = """
    import asyncio, can
    from test_can import Motor
    other = Motor("looped handlers", 7)
    done = []
    async def main():
        async with motorlink.aio.rmd.open(motorlink.can.from_python_can(line), timeout=0.02) as bus:
            on_signal(lambda: done.append(bus.moving))
            thread = signals_until(lambda: len(done) >= 50)
            while thread.is_alive():
                # Sending and making an exception are what handlers may interrupt.
                asks = [bus.motor(7 if n else 3).motion_status() for n in range(40)]
                silent, *answers = await asyncio.gather(*asks, return_exceptions=True)
                assert isinstance(silent, motorlink.ReplyTimeoutError), silent
    with can.Bus("looped handlers", interface="virtual") as line:
        asyncio.run(main())
    other.end()
    print(len(done) >= 50)
"""


def test_a_handler_may_ask_a_bus_of_asyncio_whenever_it_comes() -> None:
    assert ends(program(ASYNC_ON_PYTHON_CAN)) == ["True"]


SECOND_SIGNAL = """
    with motorlink.st.open(sys.argv[1], timeout=30.0, on_close="nothing") as bus:
        motor = bus.motor(1)
        motor.get("SPEED_MEAS")
        def stop():
            signal.signal(signal.SIGUSR1, lambda *_: None)
            signal_later(0.1)
            try:
                motor.get("SPEED_REF")
            except KeyboardInterrupt:
                print("interrupted", flush=True)
            motor.stop()
        on_signal(stop)
        signal_later(0.1)
        waits(lambda: motor.get("SPEED_REF"))
"""


def test_a_handler_may_itself_be_interrupted(tmp_path: Path) -> None:
    drive = Drive(tmp_path / "st0", 3)
    drive.is_deaf_to = REGISTERS["SPEED_REF"]
    nested = program(SECOND_SIGNAL, str(drive.path))
    try:
        eventually(lambda: drive.unanswered == 2, "a request from within another")
        nested.send_signal(signal.SIGINT)
        assert ends(nested) == ["interrupted", "PortError True"]
        assert drive.executed == [(1, STOP), (1, STOP)]
    finally:
        nested.kill()
        nested.communicate()
        drive.unplug()
