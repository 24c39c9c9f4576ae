"""RMD V1.62 as bytes on the bus: python-can commands simulated motors with hand-made frames.

What a motor does with each frame is tested in crates/proto/tests/rmd_drive.rs and rmd_exhaustive.rs.
"""

import struct
import threading

import can
import pytest

from program import eventually

READ_PID, PID_TO_RAM, PID_TO_ROM, READ_ACCEL, ACCEL_TO_RAM = 0x30, 0x31, 0x32, 0x33, 0x34
MULTI_TURN, SINGLE_TURN = 0x92, 0x94
STATUS_1, STATUS_2 = 0x9A, 0x9C
OFF, STOP, RUN = 0x80, 0x81, 0x88
TORQUE, SPEED, MOVE, MOVE_LIMITED, TURN_LIMITED = 0xA1, 0xA2, 0xA3, 0xA4, 0xA6
MULTI_TORQUE_ID = 0x280
ANSWER_WITHIN = 5


class Host:
    """A host on the CAN bus."""

    def __init__(self, channel):
        self.bus = can.Bus(
            interface="slcan", channel=channel, bitrate=1_000_000, sleep_after_open=0
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.bus.shutdown()

    def send(self, can_id, data, **kind):
        kind.setdefault("is_extended_id", False)
        self.bus.send(can.Message(arbitration_id=can_id, data=data, **kind))

    def receive(self):
        """The next frame: its identifier and its data."""
        message = self.bus.recv(ANSWER_WITHIN)
        assert message is not None, "no reply"
        assert not message.is_extended_id and not message.is_remote_frame and message.dlc == 8
        return message.arbitration_id, bytes(message.data)

    def ask(self, motor, code, rest=b""):
        """Sends a command with the bytes behind its code; gives the eight bytes of the reply."""
        self.send(0x140 + motor, bytes([code, *rest]).ljust(8, b"\0"))
        can_id, data = self.receive()
        assert can_id == 0x140 + motor
        assert data[0] == code
        return data

    def read(self, motor, code, layout):
        """Values of a reply, as `struct` lays them out behind the command byte."""
        return struct.unpack("<x" + layout, self.ask(motor, code))

    def multi_turn_angle(self, motor):
        """Degrees, from 56 bits of hundredths."""
        data = self.ask(motor, MULTI_TURN)
        return int.from_bytes(data[1:], "little", signed=True) / 100

    def single_turn_angle(self, motor):
        return self.read(motor, SINGLE_TURN, "5xH")[0] / 100

    def speed(self, motor):
        """°/s, from the motor's status 2."""
        _, _, speed, _ = self.motion(motor)
        return speed

    def motion(self, motor):
        """Temperature, torque current, speed, encoder."""
        return self.read(motor, STATUS_2, "bhhH")

    def hears_nothing_of(self, motor):
        """The next frame on the bus is the answer to a question asked now."""
        self.ask(motor, READ_ACCEL)


def null(layout, *values):
    """Bytes behind the code: `x` is NULL, sent as zero."""
    return struct.pack("<" + layout, *values)


@pytest.fixture
def simulator(sim):
    return sim(st=())


@pytest.fixture
def host(simulator):
    with Host(simulator.can) as host:
        yield host


def test_each_motor_answers_under_its_own_identifier_with_the_bytes_of_the_document(host):
    for motor in (1, 2, 3, 4):
        assert host.ask(motor, STATUS_1) == bytes([STATUS_1, 25, 0, 240, 0, 0, 0, 0])
    assert host.motion(1) == (25, 0, 0, 0)
    assert host.ask(1, READ_PID) == bytes([READ_PID, 0] + [100] * 6)
    host.ask(1, ACCEL_TO_RAM, null("3xi", 0x01020304))
    assert host.ask(1, READ_ACCEL) == bytes([READ_ACCEL, 0, 0, 0, 4, 3, 2, 1])


def test_null_bytes_are_ignored_and_an_echoing_reply_echoes_them(host):
    for code in (PID_TO_RAM, PID_TO_ROM, ACCEL_TO_RAM, OFF, STOP, RUN):
        sent = bytes([0xA5, 1, 2, 3, 4, 5, 6])
        assert host.ask(1, code, sent) == bytes([code]) + sent
    for code in (READ_PID, READ_ACCEL, MULTI_TURN, STATUS_1, STATUS_2):
        assert host.ask(1, code, b"\xff" * 7) == host.ask(1, code)


def test_frames_of_another_form_or_for_nobody_are_ignored(host):
    status = bytes([STATUS_1]).ljust(8, b"\0")
    for size in range(8):
        host.send(0x141, status[:size])
    host.send(0x141, status, is_extended_id=True)
    host.send(0x141, None, is_remote_frame=True, dlc=8)
    host.send(0x141, bytes([0x60]).ljust(8, b"\0"))
    host.send(MULTI_TORQUE_ID, bytes(7))
    host.send(MULTI_TORQUE_ID, bytes(8), is_extended_id=True)
    for nobody in (0x140, 0x145, 0x160, 0x161, 0x241, 0x27F, 0x281):
        host.send(nobody, status)
    host.hears_nothing_of(1)


def test_four_torques_in_one_frame_turn_four_motors_which_answer_lowest_id_first(host):
    for _ in range(5):
        host.send(MULTI_TORQUE_ID, struct.pack("<4h", 60, -60, 60, -60))
        replies = [host.receive() for _ in range(4)]
        assert [can_id for can_id, _ in replies] == [0x141, 0x142, 0x143, 0x144]
        assert {data[0] for _, data in replies} == {TORQUE}

    def all_turn():
        speeds = [host.speed(motor) for motor in (1, 2, 3, 4)]
        return all(speed * way > 100 for speed, way in zip(speeds, (1, -1, 1, -1)))

    eventually(all_turn, "each motor turns its way")


def test_a_position_command_turns_no_faster_than_it_says(host):
    host.ask(1, MOVE_LIMITED, null("xHi", 300, 36000))
    fastest = 0

    def arrived():
        nonlocal fastest
        fastest = max(fastest, host.speed(1))
        return is_at(host.multi_turn_angle(1), 360)

    eventually(arrived, "motor 1 is at 360°")
    assert 200 < fastest < 330
    host.ask(1, MOVE, null("3xi", -4000))
    eventually(lambda: is_at(host.multi_turn_angle(1), -40), "motor 1 is at -40°")


def test_a_single_turn_position_is_reached_the_way_that_is_asked(host):
    for direction, turned in ((0, 90), (1, -270)):
        host.ask(3, TURN_LIMITED, null("BHHxx", direction, 500, 9000))
        eventually(lambda: is_at(host.multi_turn_angle(3), turned), f"motor 3 turned by {turned}°")
        assert is_at(host.single_turn_angle(3), 90)


def test_run_resumes_what_stop_interrupted_and_nothing_after_off(host):
    host.ask(1, SPEED, null("3xi", -72000))
    eventually(lambda: host.speed(1) < -700, "motor 1 turns")
    host.ask(1, STOP)
    eventually(lambda: host.speed(1) == 0, "motor 1 stands")
    host.ask(1, RUN)
    eventually(lambda: host.speed(1) < -700, "motor 1 turns again")
    host.ask(1, OFF)
    host.ask(1, RUN)
    eventually(lambda: host.speed(1) == 0, "motor 1 runs out")


def is_at(angle, degrees):
    return abs(angle - degrees) < 0.5


def test_two_hosts_command_different_motors_at_once(sim):
    channel = f"socket://{sim(st=(), rmd=('tcp',)).can_address}"
    failures = []

    def command(motor):
        try:
            with Host(channel) as host:
                for gain in range(50):
                    request = bytes([PID_TO_RAM, motor] + [gain] * 6)
                    host.send(0x140 + motor, request)
                    # The other host's requests and what its motor answers pass by.
                    while host.receive() != (0x140 + motor, request):
                        pass
        except BaseException as failure:
            failures.append(failure)

    threads = [threading.Thread(target=command, args=(motor,)) for motor in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    assert not failures, failures
