"""Buses of python-can as ports, with simulated motors on them."""

from __future__ import annotations

import asyncio
import builtins
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus
from conftest import Served, eventually

import motorlink
from motorlink import aio, rmd
from motorlink.can import CanPort, from_python_can


class Motor(threading.Thread):
    """A motor on a virtual bus. It replies with its ID as its speed, and sends other frames."""

    def __init__(self, channel: str, id: int):
        super().__init__(daemon=True)
        self.bus = can.Bus(channel, interface="virtual")
        self.id = id
        self.heard: list[int] = []
        self.ended = False
        self.start()

    def run(self) -> None:
        while not self.ended:
            message = self.bus.recv(0.05)
            if message is None or message.arbitration_id != 0x140 + self.id:
                continue
            self.heard.append(message.data[0])
            reply = bytes([message.data[0], 25, 0, 0]) + self.id.to_bytes(2, "little") + bytes(2)
            # None of these frames is the reply.
            wrong = bytes([message.data[0]]) + bytes(7)
            for strange in (
                can.Message(arbitration_id=0x140 + self.id, data=wrong, is_extended_id=True),
                can.Message(arbitration_id=0x140 + self.id, is_extended_id=False, is_remote_frame=True, dlc=8),
                can.Message(arbitration_id=0x140 + self.id, is_extended_id=False, is_error_frame=True),
                can.Message(arbitration_id=0x140 + self.id, data=wrong[:4], is_extended_id=False),
                can.Message(arbitration_id=0x140 + self.id, data=bytes(12), is_fd=True, is_extended_id=False),
            ):
                self.bus.send(strange)
            if message.data[0] in (0x80, 0x81):
                reply = bytes(message.data)
            self.bus.send(
                can.Message(arbitration_id=0x140 + self.id, data=reply, is_extended_id=False)
            )

    def end(self) -> None:
        self.ended = True
        self.join()
        self.bus.shutdown()


@pytest.fixture
def motor(request: pytest.FixtureRequest) -> Iterator[Motor]:
    motor = Motor(request.node.name, 7)
    yield motor
    motor.end()


@pytest.fixture
def bus(request: pytest.FixtureRequest) -> Iterator[can.BusABC]:
    """The host's bus, which also receives its own frames."""
    bus = can.Bus(request.node.name, interface="virtual", receive_own_messages=True)
    yield bus
    bus.shutdown()


def test_a_motor_on_a_bus_of_python_can_is_commanded(bus: can.BusABC, motor: Motor) -> None:
    with rmd.open(from_python_can(bus), timeout=2) as motors:
        assert motors.motor(7).motion_status().speed_dps == 7
        # The reply has the bytes of the request, like an echo of the bus.
        motors.motor(7).stop()
        assert motors.cycle({7: rmd.set_speed(100)})[7].speed_dps == 7
        assert motors.moving == [7]
        assert "python-can" in motors.port
    # The client first reads the status twice, because another program may have sent a request.
    assert motor.heard == [0x9A, 0x9C] + [0x9C, 0x81, 0xA2, 0x81]


def test_an_echo_is_not_a_reply(bus: can.BusABC) -> None:
    with rmd.open(from_python_can(bus), timeout=0.05) as motors:
        with pytest.raises(motorlink.ReplyTimeoutError, match="motor 3"):
            motors.exchange(3, rmd.stop())


def test_asyncio_commands_it_too(bus: can.BusABC, motor: Motor) -> None:
    async def main() -> None:
        async with aio.rmd.open(from_python_can(bus), timeout=2) as motors:
            one = motors.motor(7)
            answers = await asyncio.gather(*(one.motion_status() for _ in range(20)))
            assert all(answer.speed_dps == 7 for answer in answers)
            await one.set_speed(100)

    # Threads of earlier tests may end meanwhile.
    threads = set(threading.enumerate())
    asyncio.run(asyncio.wait_for(main(), 60))
    assert motor.heard[-1] == 0x81
    left = set(threading.enumerate()) - threads
    # This one lasts as long as the program.
    assert {thread.name for thread in left} <= {"motorlink-signals"}
    # No thread receives from it any more.
    motor.bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    message = bus.recv(5)
    while message is not None and message.arbitration_id != 0x123:
        message = bus.recv(5)
    assert message is not None


class Broken(can.bus.BusABC):
    """A bus whose adapter is unplugged after some frames."""

    def __init__(self, frames: int):
        super().__init__(channel="broken")
        self.channel_info = "broken"
        self.left = frames

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.left -= 1
        if self.left < 0:
            raise can.CanOperationError("the adapter is gone")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.left <= 0:
            raise can.CanOperationError("the adapter is gone")
        return None, False


def check(error: BaseException) -> None:
    assert isinstance(error, motorlink.LinkError)
    assert "the adapter is gone" in str(error)
    assert isinstance(error.__cause__, can.CanOperationError)


@pytest.mark.parametrize("frames", [0, 1])
def test_an_exception_of_the_bus_is_the_cause_of_a_lost_line(frames: int) -> None:
    bus = Broken(frames)
    with rmd.open(from_python_can(bus), timeout=5, on_close="nothing") as motors:
        # The second request tries again and fails with the same error.
        for _ in range(2):
            with pytest.raises(motorlink.LinkError) as lost:
                motors.motor(1).motion_status()
            check(lost.value)
    bus.shutdown()


class Flaky(VirtualBus):
    """A bus that fails sometimes."""

    def __init__(self, channel: str):
        self.fails_to_send = self.fails_to_receive = 0
        super().__init__(channel)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.fails_to_send > 0:
            self.fails_to_send -= 1
            raise can.CanOperationError("no room")
        super().send(msg, timeout)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.fails_to_receive > 0:
            self.fails_to_receive -= 1
            raise can.CanOperationError("no room")
        return super()._recv_internal(timeout)


@pytest.fixture
def flaky(request: pytest.FixtureRequest) -> Iterator[Flaky]:
    bus = Flaky(request.node.name)
    yield bus
    bus.shutdown()


def test_a_bus_that_failed_once_is_used_again(flaky: Flaky, motor: Motor) -> None:
    with rmd.open(from_python_can(flaky), timeout=2) as motors:
        one = motors.motor(7)
        one.set_speed(100)
        flaky.fails_to_send = 1
        with pytest.raises(motorlink.LinkError, match="no room"):
            one.motion_status()
        assert one.motion_status().speed_dps == 7
        flaky.fails_to_receive = 1
        eventually(lambda: flaky.fails_to_receive == 0, "a failure while nothing is asked")
        flaky.fails_to_send = 3
        one.stop()
        assert motors.moving == []
        one.set_speed(100)
    assert motor.heard[-1] == 0x81


def test_stops_are_sent_if_receiving_fails(flaky: Flaky, motor: Motor) -> None:
    with rmd.open(from_python_can(flaky), timeout=2, on_close="nothing") as motors:
        motors.motor(7).set_speed(100)
        flaky.fails_to_receive = 1_000_000
        motor.heard.clear()
        with pytest.raises(motorlink.LinkError, match="no room"):
            motors.motor(7).stop()
        # An attempt on a port that may not be opened again yet sends nothing.
        eventually(lambda: motor.heard.count(0x81) >= 2, "frames that stop the motor")


def test_a_bus_that_failed_once_is_used_again_by_asyncio(flaky: Flaky, motor: Motor) -> None:
    async def main() -> None:
        async with aio.rmd.open(from_python_can(flaky), timeout=2) as motors:
            one = motors.motor(7)
            await one.set_speed(100)
            flaky.fails_to_send = 1
            with pytest.raises(motorlink.LinkError, match="no room"):
                await one.motion_status()
            assert (await one.motion_status()).speed_dps == 7
            flaky.fails_to_receive = 1
            while flaky.fails_to_receive:
                await asyncio.sleep(0.005)
            assert (await one.motion_status()).speed_dps == 7

    asyncio.run(asyncio.wait_for(main(), 60))
    assert motor.heard[-1] == 0x81


INTERRUPTED = """\
import can, motorlink
from test_can import Motor
other = Motor("interrupted", 7)
with can.Bus("interrupted", interface="virtual") as line:
    try:
        with motorlink.rmd.open(motorlink.can.from_python_can(line), timeout=30.0) as bus:
            for _ in range(2):
                bus.motor(7).set_speed(100)
                try:
                    print("asks", flush=True)
                    bus.motor(3).motion_status()
                except KeyboardInterrupt:
                    print("interrupted", bus.motor(7).motion_status().speed_dps, flush=True)
            print("asks", flush=True)
            bus.motor(3).motion_status()
    finally:
        print(other.heard[-1] == 0x81, flush=True)
        other.end()
"""


def test_ctrl_c_interrupts_a_wait_and_leaves_the_bus_open() -> None:
    words = [sys.executable, "-c", INTERRUPTED]
    folder = Path(__file__).parent
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder) as program:
        assert program.stdout
        try:
            for line in ["interrupted 7\n"] * 2 + ["True\n"]:
                assert program.stdout.readline() == "asks\n"
                program.send_signal(signal.SIGINT)
                assert program.stdout.readline() == line
            _, err = program.communicate(timeout=60)
            assert err.splitlines()[-1] == "KeyboardInterrupt"
        finally:
            program.kill()


def test_served_motors_through_python_cans_own_slcan(served: Served) -> None:
    path = served.can.partition(":")[2]
    with can.Bus(path, interface="slcan", bitrate=1_000_000, sleep_after_open=0) as bus:
        with rmd.open(from_python_can(bus), timeout=2) as motors:
            motors.motor(1).set_speed(180)
            while motors.motor(1).motion_status().speed_dps < 100:
                pass
            assert [one.id for one in motors.scan([1, 2, 3, 4])] == [1, 2, 3, 4]
    assert served.motor("rmd", 1)["mode"] == "stopped"


def test_without_python_can_the_error_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name == "can":
            raise ImportError("No module named 'can'", name="can")
        return real(name, *rest)

    monkeypatch.setattr("importlib.import_module", missing)
    with pytest.raises(ImportError, match=r"pip install \"motorlink\[can\]\""):
        from_python_can(object())


def test_another_object_is_refused() -> None:
    with pytest.raises(TypeError, match="not a bus of python-can"):
        from_python_can("can0")
    port = CanPort(None, None, "nothing")
    assert repr(port) == "<CanPort nothing>"
