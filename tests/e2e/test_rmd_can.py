"""RMD V1.62 as bytes on the bus: python-can commands simulated motors with hand-made frames."""

import struct
import threading

import can
import pytest

from program import eventually

READ_PID, PID_TO_RAM, PID_TO_ROM, READ_ACCEL, ACCEL_TO_RAM = 0x30, 0x31, 0x32, 0x33, 0x34
READ_ENCODER, WRITE_OFFSET, ZERO_TO_ROM, MULTI_TURN, SINGLE_TURN = 0x90, 0x91, 0x19, 0x92, 0x94
STATUS_1, CLEAR_ERROR, STATUS_2, STATUS_3 = 0x9A, 0x9B, 0x9C, 0x9D
OFF, STOP, RUN = 0x80, 0x81, 0x88
TORQUE, SPEED, MOVE, MOVE_LIMITED, TURN, TURN_LIMITED = 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6
KNOWN = {*range(0x30, 0x35), 0x19, 0x80, 0x81, 0x88, 0x90, 0x91, 0x92, 0x94}
KNOWN |= {*range(0x9A, 0x9E), *range(0xA1, 0xA7)}
MULTI_TORQUE_ID = 0x280
LOW_VOLTAGE, OVER_TEMPERATURE = 0x01, 0x08
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

    def ask(self, motor, code, rest=b"", answered_by=None):
        """Sends a command with the bytes behind its code; gives the eight bytes of the reply."""
        self.send(0x140 + motor, bytes([code, *rest]).ljust(8, b"\0"))
        can_id, data = self.receive()
        assert can_id == 0x140 + motor
        assert data[0] == (answered_by or code)
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

    def errors(self, motor):
        return self.ask(motor, STATUS_1)[7]

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


# Every command of the document: its reply's identifier, command byte and layout.


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_each_motor_answers_under_its_own_identifier(host, motor):
    host.ask(motor, STATUS_1)


def test_the_gains_are_six_bytes_from_data_2_on(host):
    assert host.ask(1, READ_PID) == bytes([READ_PID, 0] + [100] * 6)


def test_the_acceleration_limit_is_an_i32_in_data_4_to_7(host):
    assert host.read(1, READ_ACCEL, "3xi") == (0,)
    host.ask(1, ACCEL_TO_RAM, null("3xi", 0x01020304))
    assert host.ask(1, READ_ACCEL) == bytes([READ_ACCEL, 0, 0, 0, 4, 3, 2, 1])


@pytest.mark.parametrize("code", [PID_TO_RAM, PID_TO_ROM, ACCEL_TO_RAM, OFF, STOP, RUN])
def test_an_echoing_reply_echoes_the_null_bytes_too(host, code):
    sent = bytes([0xA5, 1, 2, 3, 4, 5, 6])
    assert host.ask(1, code, sent) == bytes([code]) + sent


@pytest.mark.parametrize("code", [READ_PID, READ_ACCEL, MULTI_TURN, STATUS_1, STATUS_2])
def test_null_bytes_of_a_read_command_are_ignored(host, code):
    assert host.ask(1, code, b"\xff" * 7) == host.ask(1, code)


def test_a_motor_at_rest_reports_its_voltage_and_temperature(host):
    assert host.ask(1, STATUS_1) == bytes([STATUS_1, 25, 0, 240, 0, 0, 0, 0])


def test_clear_error_is_answered_with_0x9a_as_printed(host):
    assert host.ask(1, CLEAR_ERROR, answered_by=STATUS_1)[7] == 0


def test_clear_error_is_answered_with_0x9b_by_motors_that_do(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 32\nclear_reply_0x9b = true\n")
    with Host(sim(config, st=()).can) as host:
        host.ask(32, CLEAR_ERROR)


def test_status_2_has_temperature_current_speed_and_encoder(host):
    assert host.motion(1) == (25, 0, 0, 0)


def test_the_phase_currents_add_up_to_nothing(host):
    for rest in (b"", b"\xff" * 7):
        nothing = struct.unpack("<xxhhh", host.ask(1, STATUS_3, rest))
        assert max(map(abs, nothing)) <= 5, "noise of the sensors"
    host.ask(1, TORQUE, null("3xhxx", 200))

    def current_flows():
        phases = host.read(1, STATUS_3, "xhhh")
        assert abs(sum(phases)) <= 1
        return max(map(abs, phases)) > 64

    eventually(current_flows, "more than 1 A in a phase")


@pytest.mark.parametrize("code", [TORQUE, SPEED, MOVE, MOVE_LIMITED, TURN, TURN_LIMITED])
def test_a_closed_loop_command_is_answered_as_status_2_is(host, code):
    assert host.ask(1, code) == bytes([code, 25, 0, 0, 0, 0, 0, 0])


def test_an_unknown_command_is_met_with_silence(host):
    for code in set(range(256)) - KNOWN:
        host.send(0x141, bytes([code]).ljust(8, b"\0"))
    host.hears_nothing_of(1)


def test_frames_of_another_form_or_for_nobody_are_ignored(host):
    status = bytes([STATUS_1]).ljust(8, b"\0")
    for size in range(8):
        host.send(0x141, status[:size])
    host.send(0x141, status, is_extended_id=True)
    host.send(0x141, None, is_remote_frame=True, dlc=8)
    host.send(MULTI_TORQUE_ID, bytes(7))
    host.send(MULTI_TORQUE_ID, bytes(8), is_extended_id=True)
    for nobody in (0x140, 0x145, 0x160, 0x161, 0x241, 0x27F, 0x281):
        host.send(nobody, status)
    host.hears_nothing_of(1)


def test_four_torques_in_one_frame_are_answered_lowest_id_first(host):
    for _ in range(20):
        host.send(MULTI_TORQUE_ID, bytes(8))
        replies = [host.receive() for _ in range(4)]
        assert [can_id for can_id, _ in replies] == [0x141, 0x142, 0x143, 0x144]
        assert {data[0] for _, data in replies} == {TORQUE}


def test_motors_beyond_4_do_not_hear_the_four_torques(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("".join(f"[[rmd.motor]]\nid = {motor}\n" for motor in (2, 5, 32)))
    with Host(sim(config, st=()).can) as host:
        host.send(MULTI_TORQUE_ID, bytes(8))
        assert host.receive()[0] == 0x142
        host.hears_nothing_of(5)
        host.hears_nothing_of(32)


# Commands that turn the motor.


def test_four_torques_turn_four_motors_each_its_way(host):
    host.send(MULTI_TORQUE_ID, struct.pack("<4h", 60, -60, 60, -60))
    for _ in range(4):
        host.receive()

    def all_turn():
        speeds = [host.speed(motor) for motor in (1, 2, 3, 4)]
        return all(speed * way > 100 for speed, way in zip(speeds, (1, -1, 1, -1)))

    eventually(all_turn, "each motor turns its way")


@pytest.mark.parametrize("dps", [360, -720])
def test_a_speed_command_turns_the_motor_at_that_speed(host, dps):
    host.ask(2, SPEED, null("3xi", dps * 100))
    eventually(lambda: abs(host.speed(2) - dps) <= 10, f"motor 2 turns with {dps} °/s")
    before = host.multi_turn_angle(2)
    eventually(lambda: (host.multi_turn_angle(2) - before) * dps > 0, "the angle follows")


@pytest.mark.parametrize("degrees", [90, -400])
def test_a_position_command_reaches_the_multi_turn_angle(host, degrees):
    host.ask(1, MOVE, null("3xi", degrees * 100))
    eventually(lambda: is_at(host.multi_turn_angle(1), degrees), f"motor 1 is at {degrees}°")


def test_a_position_command_turns_no_faster_than_it_says(host):
    host.ask(1, MOVE_LIMITED, null("xHi", 300, 36000))
    fastest = 0

    def arrived():
        nonlocal fastest
        fastest = max(fastest, host.speed(1))
        return is_at(host.multi_turn_angle(1), 360)

    eventually(arrived, "motor 1 is at 360°")
    assert 200 < fastest < 330


@pytest.mark.parametrize("code, limit", [(TURN, 0), (TURN_LIMITED, 500)])
@pytest.mark.parametrize("direction, turned", [(0, 90), (1, -270)])
def test_a_single_turn_position_is_reached_the_way_that_is_asked(
    host, code, limit, direction, turned
):
    host.ask(3, code, null("BHHxx", direction, limit, 9000))
    eventually(lambda: is_at(host.multi_turn_angle(3), turned), f"motor 3 turned by {turned}°")
    assert is_at(host.single_turn_angle(3), 90)


def test_run_resumes_what_stop_interrupted_and_nothing_after_off(host):
    host.ask(1, SPEED, null("3xi", 36000))
    eventually(lambda: host.speed(1) > 340, "motor 1 turns")
    host.ask(1, STOP)
    eventually(lambda: host.speed(1) == 0, "motor 1 stands")
    host.ask(1, RUN)
    eventually(lambda: host.speed(1) > 340, "motor 1 turns again")
    host.ask(1, OFF)
    host.ask(1, RUN)
    eventually(lambda: host.speed(1) == 0, "motor 1 runs out")


def is_at(angle, degrees):
    return abs(angle - degrees) < 0.5


# RAM and ROM, faults.


def test_gains_in_ram_are_gone_after_a_power_cycle_and_those_in_rom_are_not(simulator, host):
    host.ask(1, PID_TO_RAM, bytes([0, 1, 2, 3, 4, 5, 6]))
    assert host.ask(1, READ_PID)[2:] == bytes([1, 2, 3, 4, 5, 6])
    simulator.do("power-cycle", motor=1)
    assert host.ask(1, READ_PID)[2:] == bytes([100] * 6)

    host.ask(1, PID_TO_ROM, bytes([0, 7, 8, 9, 10, 11, 12]))
    assert host.ask(1, READ_PID)[2:] == bytes([7, 8, 9, 10, 11, 12])
    simulator.do("power-cycle", motor=1)
    assert host.ask(1, READ_PID)[2:] == bytes([7, 8, 9, 10, 11, 12])
    assert host.ask(2, READ_PID)[2:] == bytes([100] * 6)
    assert simulator.motor(1)["rom_writes"] == 1


def test_an_acceleration_limit_is_gone_after_a_power_cycle(simulator, host):
    host.ask(1, ACCEL_TO_RAM, null("3xi", 500))
    simulator.do("power-cycle")
    assert host.read(1, READ_ACCEL, "3xi") == (0,)


def test_an_encoder_offset_is_for_good(simulator, host):
    assert host.ask(1, WRITE_OFFSET, null("5xH", 1000)) == null("B5xH", WRITE_OFFSET, 1000)
    assert host.read(1, READ_ENCODER, "xHHH") == ((0 - 1000) % 16384, 0, 1000)
    simulator.do("power-cycle", motor=1)
    assert host.read(1, READ_ENCODER, "xHHH") == ((0 - 1000) % 16384, 0, 1000)


def test_a_new_zero_counts_from_the_next_power_on_on(simulator, host):
    host.ask(1, MOVE, null("3xi", 9000))
    eventually(lambda: is_at(host.multi_turn_angle(1), 90), "motor 1 is at 90°")
    host.ask(1, OFF)
    eventually(lambda: host.speed(1) == 0, "motor 1 stands")
    (offset,) = struct.unpack("<6xH", host.ask(1, ZERO_TO_ROM))
    assert abs(offset - 16384 / 4) < 30
    assert is_at(host.single_turn_angle(1), 90)

    simulator.do("power-cycle", motor=1)
    assert min(host.single_turn_angle(1), 360 - host.single_turn_angle(1)) < 0.5
    assert host.read(1, READ_ENCODER, "5xH") == (offset,)


def test_low_voltage_is_flagged_and_stays_while_the_supply_is_low(simulator, host):
    host.ask(1, SPEED, null("3xi", 36000))
    eventually(lambda: host.speed(1) > 340, "motor 1 turns")
    simulator.do("supply", motor=1, volts=6.0)
    eventually(lambda: host.errors(1) == LOW_VOLTAGE, "the low voltage flag")
    eventually(lambda: host.ask(1, STATUS_1)[3] == 60, "the capacitor is empty")
    reply = host.ask(1, CLEAR_ERROR, answered_by=STATUS_1)
    assert reply == bytes([STATUS_1, reply[1], 0, 60, 0, 0, 0, LOW_VOLTAGE])
    eventually(lambda: host.speed(1) == 0, "motor 1 is off")

    simulator.do("supply", motor=1, volts=24.0)
    eventually(lambda: host.ask(1, STATUS_1)[3] == 240, "24 V")
    assert host.errors(1) == LOW_VOLTAGE, "it stays until it is cleared"
    assert host.ask(1, CLEAR_ERROR, answered_by=STATUS_1)[7] == 0
    assert host.errors(1) == 0
    assert host.errors(2) == 0


def test_over_temperature_is_flagged_and_cleared_when_the_motor_is_cool(simulator, host):
    simulator.do("temperature", motor=2, celsius=110)
    eventually(lambda: host.errors(2) == OVER_TEMPERATURE, "the temperature flag")
    assert host.ask(2, CLEAR_ERROR, answered_by=STATUS_1)[1] == 110
    simulator.do("temperature", motor=2)

    def cleared():
        return host.ask(2, CLEAR_ERROR, answered_by=STATUS_1)[7] == 0

    eventually(cleared, "the flag is cleared")


# What the vendor's tool sets.


def test_an_encoder_of_18_bits_travels_with_its_upper_16(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nplant.encoder.bits = 18\nplant.angle_degrees = 90.0\n")
    with Host(sim(config, st=()).can) as host:
        assert host.read(1, READ_ENCODER, "xHHH") == (16384, 16384, 0)
        assert is_at(host.single_turn_angle(1), 90)


def test_a_motor_that_hears_nothing_for_its_shutdown_time_is_off(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nshutdown_ms = 400\n")
    simulator = sim(config, st=())
    with Host(simulator.can) as host:
        host.ask(1, SPEED, null("3xi", 36000))
        eventually(lambda: host.speed(1) > 300, "motor 1 turns while it is asked")
        eventually(lambda: simulator.motor(1)["mode"] == "off", "motor 1 is off")


def test_max_angle_and_max_speed_hold_a_position_command(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nmax_angle_degrees = 45.0\nmax_speed_dps = 200.0\n")
    simulator = sim(config, st=())
    with Host(simulator.can) as host:
        host.ask(1, MOVE, null("3xi", 9000))
        eventually(lambda: is_at(host.multi_turn_angle(1), 45), "motor 1 is at 45°")
        eventually(lambda: host.speed(1) == 0, "motor 1 stands")


# slcan over TCP.


def test_motors_answer_over_tcp_as_well(sim):
    with Host(f"socket://{sim(st=(), rmd=('tcp',)).can_address}") as host:
        assert host.ask(1, STATUS_1)[3] == 240
        host.ask(1, SPEED, null("3xi", 36000))
        eventually(lambda: host.speed(1) > 340, "motor 1 turns")


def test_two_hosts_on_one_bus_hear_each_other(sim):
    channel = f"socket://{sim(st=(), rmd=('tcp',)).can_address}"
    with Host(channel) as one:
        # A host that was answered has its channel open.
        one.ask(1, STATUS_1)
        with Host(channel) as other:
            answer = other.ask(2, STATUS_1)
        assert one.receive() == (0x142, bytes([STATUS_1]).ljust(8, b"\0"))
        assert one.receive() == (0x142, answer)


def test_two_hosts_command_different_motors_at_once(sim):
    channel = f"socket://{sim(st=(), rmd=('tcp',)).can_address}"
    failures = []

    def command(motor):
        try:
            with Host(channel) as host:
                for gain in range(100):
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
