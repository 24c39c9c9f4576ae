"""asyncio on a CAN bus: overlapping exchanges, late replies, and moving motors at the end."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable, Iterator

import pytest
from conftest import PATIENT

import motorlink
from motorlink import aio, rmd


class Motors:
    """An slcan adapter over TCP. The speed of a motor is its ID. The test chooses the delay of replies."""

    def __init__(self, delay: Callable[[int], float] = lambda id: 0.0):
        self.delay = delay
        #: Replies are sent when there are so many.
        self.together = 1
        #: Whether each reply is sent twice.
        self.twice = False
        self._replies: list[bytes] = []
        #: The received requests: ID and command.
        self.heard: list[tuple[int, int]] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"slcan:tcp:127.0.0.1:{self._listener.getsockname()[1]}"
        self._clients: list[socket.socket] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            self._clients.append(client)
            line = b""
            # The client has closed the connection.
            with contextlib.suppress(OSError):
                while received := client.recv(4096):
                    line += received
                    *lines, line = line.split(b"\r")
                    for one in lines:
                        self._take(client, one)

    @staticmethod
    def _send(client: socket.socket, frame: bytes) -> None:
        with contextlib.suppress(OSError):
            client.sendall(frame)

    def _take(self, client: socket.socket, line: bytes) -> None:
        if not line.startswith(b"t"):
            client.sendall(b"\r")
            return
        client.sendall(b"z\r")
        can_id, data = int(line[1:4], 16), bytes.fromhex(line[5:21].decode())
        ids = range(1, 5) if can_id == 0x280 else [can_id - 0x140]
        for id in ids:
            code = 0xA1 if can_id == 0x280 else data[0]
            self.heard.append((id, code))
            if id > 8:
                continue
            reply = bytes([code, 25, 0, 0]) + id.to_bytes(2, "little") + bytes(2)
            if code in (0x80, 0x81):
                reply = data
            frame = b"t%03X8%s\r" % (0x140 + id, reply.hex().upper().encode())
            if self.twice:
                frame *= 2
            delay = self.delay(id)
            if delay:
                timer = threading.Timer(delay, self._send, [client, frame])
                timer.daemon = True
                timer.start()
                continue
            self._replies.append(frame)
            if len(self._replies) >= self.together:
                client.sendall(b"".join(self._replies))
                self._replies.clear()

    def hang_up(self) -> None:
        for client in self._clients:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
            client.close()
        self._clients.clear()

    def end(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.hang_up()


@pytest.fixture
def motors() -> Iterator[Motors]:
    motors = Motors()
    yield motors
    motors.end()


def test_exchanges_with_different_motors_overlap(motors: Motors) -> None:
    async def main() -> None:
        async with aio.rmd.open(motors.port, timeout=5) as bus:
            motors.together = 8
            answers = await asyncio.gather(*(bus.motor(id).motion_status() for id in range(1, 9)))
            assert [answer.speed_dps for answer in answers] == list(range(1, 9))
            motors.together = 1
            both = await asyncio.gather(bus.motor(3).motion_status(), bus.motor(3).motion_status())
            assert [answer.speed_dps for answer in both] == [3, 3]

    asyncio.run(asyncio.wait_for(main(), 60))


def test_a_reply_that_came_twice_is_not_confirmed(motors: Motors) -> None:
    async def main() -> None:
        async with aio.rmd.open(motors.port, timeout=PATIENT) as client:
            await client.motor(1).motion_status()
            await client.confirm(1)
            motors.twice = True
            await client.motor(1).motion_status()
            motors.twice = False
            with pytest.raises(motorlink.LinkError, match="motor 1"):
                await client.confirm(1)
            assert (await client.motor(1).motion_status()).speed_dps == 1
            await asyncio.gather(client.confirm(1), client.motor(1).motion_status(), client.confirm(2))

    asyncio.run(asyncio.wait_for(main(), 60))


def test_cycles_four_torques_and_scans_return_the_reply_of_each_motor(motors: Motors) -> None:
    async def main() -> None:
        async with aio.rmd.open(motors.port, timeout=PATIENT) as bus:
            answers = await bus.cycle({2: rmd.set_speed(10), 20: rmd.read_motion_status(), 1: rmd.stop()})
            assert answers[2].speed_dps == 2 and answers[1] is None
            assert isinstance(answers[20], motorlink.ReplyTimeoutError) and answers[20].motor == 20
            four = await bus.set_torque4([0.1, 0.2, 0.3, 0.4], expect=[4, 2])
            assert [four[id] for id in (2, 4)] == [await bus.motor(id).motion_status() for id in (2, 4)]
            assert len(four) == 2
            with pytest.raises(motorlink.InvalidValueError, match="beyond"):
                await bus.set_torque4([0, 0, 0, 33])
            with pytest.raises(motorlink.InvalidValueError, match="motor 5"):
                await bus.set_torque4([0, 0, 0, 0], expect=[5])
            assert bus.moving == [2, 4], "no reply was expected from 1 and 3"
            found = await bus.scan(range(6, 13))
            assert [(one.id, one.kind) for one in found] == [(6, "motor"), (7, "motor"), (8, "motor")]

    asyncio.run(asyncio.wait_for(main(), 60))


def test_a_late_reply_to_a_cancelled_exchange_is_dropped(motors: Motors) -> None:
    async def main() -> None:
        async with aio.rmd.open(motors.port, timeout=30, quarantine=2) as bus:
            motor = bus.motor(1)
            await motor.motion_status()
            motors.heard.clear()
            motors.delay = lambda id: 0.02
            exchange = asyncio.ensure_future(motor.motion_status())
            while (1, 0x9C) not in motors.heard:
                assert not exchange.done(), exchange
                await asyncio.sleep(0)
            exchange.cancel()
            with pytest.raises(asyncio.CancelledError):
                await exchange
            motors.delay = lambda id: 0
            # The command is the same. Only the wait for the late reply separates the two.
            before = len(motors.heard)
            assert (await motor.motion_status()).speed_dps == 1
            assert motors.heard[before:] == [(1, 0x9C)], "it was asked once, after the late reply"
            # An Off does not wait.
            await motor.off()

    asyncio.run(asyncio.wait_for(main(), 60))


def test_a_lost_port_is_opened_again(motors: Motors) -> None:
    async def main() -> None:
        async with aio.rmd.open(motors.port, timeout=5) as bus:
            motors.delay = lambda id: 5.0
            waiting = [asyncio.ensure_future(bus.motor(id).motion_status()) for id in (1, 2)]
            while len(motors.heard) < 2:
                assert not any(task.done() for task in waiting), waiting
                await asyncio.sleep(0.001)
            motors.hang_up()
            for task in waiting:
                with pytest.raises(motorlink.LinkError):
                    await asyncio.wait_for(task, 10)
            motors.delay = lambda id: 0.0
            assert (await bus.motor(1).motion_status()).speed_dps == 1

    asyncio.run(asyncio.wait_for(main(), 60))


@pytest.mark.parametrize("on_close, code", [("off", 0x80), ("nothing", None)])
def test_the_end_treats_moving_motors_as_on_close_says(
    motors: Motors, on_close: str, code: int | None
) -> None:
    async def work() -> None:
        async with aio.rmd.open(motors.port, timeout=5, on_close=on_close) as bus:
            await bus.motor(1).set_speed(10)
            await bus.motor(2).set_torque(0.1)
            await bus.motor(3).motion_status()
            assert sorted(bus.moving) == [1, 2]
            await asyncio.sleep(3600)

    async def main() -> None:
        task = asyncio.ensure_future(work())
        while (3, 0x9C) not in motors.heard:
            assert not task.done(), task
            await asyncio.sleep(0.001)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(asyncio.wait_for(main(), 60))
    told = [heard for heard in motors.heard if heard[1] in (0x80, 0x81)]
    assert sorted(told) == ([] if code is None else [(1, code), (2, code)])


def test_limits_hold_before_a_frame_is_sent() -> None:
    async def main() -> None:
        async with aio.rmd.open("sim:", timeout=PATIENT) as bus:
            motor = bus.motor(2)
            motor.set_limits(speed_limit_dps=400)
            motor.set_limits(current_limit_amps=1)
            with pytest.raises(motorlink.InvalidValueError, match="nothing was sent"):
                await bus.cycle({1: rmd.set_speed(90), 2: rmd.set_speed(401)})
            with pytest.raises(motorlink.InvalidValueError, match="limit"):
                await motor.set_torque(1.1)
            assert bus.moving == []
            await motor.set_position(45, max_speed_dps=400)
            assert bus.moving == [2]

    asyncio.run(asyncio.wait_for(main(), 60))


def test_a_client_that_is_not_open_says_how_to_open_it() -> None:
    opening = aio.rmd.open("sim:")
    with pytest.raises(AttributeError, match="write `async with"):
        opening.motor(1)  # type: ignore[attr-defined]
