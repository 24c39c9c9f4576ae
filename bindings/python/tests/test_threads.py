"""Threads that share a client, the interpreter's lock, and Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

import motorlink
from conftest import Served, eventually
from drive import REGISTERS, START, STOP, Drive, value
from motorlink import rmd, st

ROUNDS = 40


def together(jobs: Sequence[Callable[[], None]]) -> None:
    """Runs each job in a thread. Raises the first exception of the threads."""
    failed: list[BaseException] = []
    begin = threading.Barrier(len(jobs))

    def run(job: Callable[[], None]) -> None:
        try:
            begin.wait(10)
            job()
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=run, args=(job,)) for job in jobs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    if failed:
        raise failed[0]


def test_eight_threads_on_a_serial_line_get_their_own_answers(served: Served) -> None:
    registers = ["SPEED_KP", "SPEED_KI", "TORQUE_KP", "FLUX_KI"]
    with st.open(served.st) as bus:

        def job(place: int) -> Callable[[], None]:
            motor, register = bus.motor(1 + place % 2), registers[place // 2]

            def run() -> None:
                for n in range(ROUNDS):
                    # No other thread writes this value.
                    value = place * 1000 + n
                    motor.set(register, value)
                    assert motor.get(register) == value

            return run

        together([job(place) for place in range(8)])


def test_other_threads_run_during_a_wait_for_a_reply() -> None:
    ours, theirs = os.openpty()
    done = threading.Event()
    rounds = 0

    def count() -> None:
        nonlocal rounds
        while not done.wait(0.001):
            rounds += 1

    counter = threading.Thread(target=count)
    try:
        with st.open(os.ttyname(theirs), timeout=1.0) as bus:
            counter.start()
            eventually(lambda: rounds > 0, "a first round")
            before = rounds
            with pytest.raises(motorlink.ReplyTimeoutError):
                bus.motor(1).get("STATUS")
            assert rounds - before > 50
    finally:
        done.set()
        counter.join()
        os.close(ours)
        os.close(theirs)


def test_closing_during_calls_of_other_threads() -> None:
    bus = st.open("sim:")
    motor = bus.motor(1)

    def use() -> None:
        with pytest.raises(motorlink.ClosedError):
            while True:
                motor.get("STATUS")

    together([use, use, use, bus.close])


def test_closing_ends_a_sampling_with_its_rows() -> None:
    for bus, what in ((st.open("sim:"), ["SPEED_MEAS"]), (rmd.open("sim:"), ["iq_amps"])):
        going = threading.Event()

        def sample(bus: st.Client | rmd.Client = bus, what: list[str] = what) -> None:
            going.set()
            with pytest.raises(motorlink.ClosedError) as closed:
                bus.sample(what, rate=100, seconds=600)
            assert closed.value.samples.dtype.names == ("t", *what)

        def close(bus: st.Client | rmd.Client = bus) -> None:
            going.wait(10)
            bus.close()

        together([sample, close])


def python(script: str, *arguments: str) -> subprocess.Popen[str]:
    """A Python program that prints `ready` and then waits for Ctrl-C."""
    words = [sys.executable, "-c", textwrap.dedent(script), *arguments]
    process = subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout and process.stdout.readline() == "ready\n"
    return process


SAMPLE = """
    import sys, motorlink
    print("ready", flush=True)
    with motorlink.st.open(sys.argv[1]) as bus:
        motor = bus.motor(1)
        motor.set_ramp(1500, 0.1)
        motor.start()
        try:
            bus.sample(["SPEED_MEAS"], rate=100, seconds=600)
        except KeyboardInterrupt as error:
            print(len(error.samples), flush=True)
            raise
"""

IMPATIENT = """
    import sys, motorlink
    with motorlink.st.open(sys.argv[1], timeout=30.0) as bus:
        motor = bus.motor(1)
        motor.start()
        print("ready", flush=True)
        for wait in (
            lambda: motor.get("SPEED_REF"),
            lambda: bus.sample(["SPEED_REF"], rate=10, seconds=60, on_error="skip"),
        ):
            try:
                wait()
                raise SystemExit("it was not interrupted")
            except KeyboardInterrupt:
                print("interrupted", flush=True)
                sys.stdin.readline()
            print(motor.get("SPEED_MEAS"), flush=True)
        print("ready", flush=True)
        motor.get("SPEED_REF")
"""


def test_ctrl_c_ends_a_wait_for_a_drive_and_the_next_exchange_is_right(tmp_path: Path) -> None:
    drive = Drive(tmp_path / "st0", 3)
    drive.is_deaf_to = REGISTERS["SPEED_REF"]
    try:
        with python(IMPATIENT, str(drive.path)) as program:
            assert program.stdin and program.stdout
            for times in (1, 2):
                eventually(lambda: drive.unanswered == times, "a request without an answer")
                program.send_signal(signal.SIGINT)
                assert program.stdout.readline() == "interrupted\n"
                program.stdin.write("\n")
                program.stdin.flush()
                told = int(program.stdout.readline())
                assert told == value(3, 1, REGISTERS["SPEED_MEAS"])
            assert program.stdout.readline() == "ready\n"
            eventually(lambda: drive.unanswered == 3, "a request without an answer")
            assert drive.executed == [(1, START)]
            program.send_signal(signal.SIGINT)
            _, err = program.communicate(timeout=10)
            assert "KeyboardInterrupt" in err and program.returncode in (130, -signal.SIGINT)
        # Once without a reply, before the line is resynchronised, and once with one.
        assert drive.executed[0] == (1, START) and set(drive.executed[1:]) == {(1, STOP)}
    finally:
        drive.unplug()


def test_ctrl_c_ends_a_long_sampling_and_stops_the_motor(served: Served) -> None:
    with python(SAMPLE, served.st) as program:
        eventually(lambda: served.motor("st", 1)["status"] == "RUN", "a motor in RUN")
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=10)
        assert int(out) > 0
        assert "KeyboardInterrupt" in err and program.returncode in (130, -signal.SIGINT)
    eventually(lambda: served.motor("st", 1)["status"] == "IDLE", "a motor at rest")
