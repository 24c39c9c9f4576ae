#!/usr/bin/env python3
"""RMD motors (CAN protocol V1.62) behind an slcan adapter, behind a TCP port.

    python3 rmd_motor.py --listen 127.0.0.1:0

Chapter names are those of the document "MOTOR CONTROL PROTOCOL (CAN BUS)
V1.62"; "HOLES n" are the entries of HOLES.md.
"""
import argparse
import struct
import time

from rmd_model import (IQ_COMMAND_PER_AMPERE, IQ_REPLY_PER_AMPERE, PHASE_PER_AMPERE,
                       Limits, RmdMotor)
from slcan import Adapter
from tcpline import LineServer

SINGLE_BASE = 0x140         # chapter 1: 0x140 + ID(1~32)
MULTI_ID = 0x280            # chapter 4
MULTI_MOTORS = 4            # chapter 4: "up to 4 motors"
STEP = 0.002
LONGEST_GAP = 5.0


def clamp16(value):
    """A number as int16, cut at its ends."""
    return max(-32768, min(32767, int(round(value))))


# ---- replies --------------------------------------------------------------

def motion_reply(motor, command):
    """Reply of 0x9C, 0xA1..0xA6: temperature, iq, speed, encoder position."""
    return struct.pack("<BbhhH", command, int(round(motor.celsius)),
                       clamp16(motor.iq * IQ_REPLY_PER_AMPERE),
                       clamp16(motor.speed), motor.encoder() & 0xFFFF)


def status_1_reply(motor, command=0x9A):
    """Reply of 0x9A and 0x9B: temperature, voltage, error state."""
    return struct.pack("<BbBHHB", command, int(round(motor.celsius)), 0,
                       int(round(motor.volts * 10)), 0, motor.error)


# ---- one function per command ("Single motor Command description") --------
# Each takes the motor and the 8 data bytes, and returns the 8 reply bytes.

def read_pid(motor, data):
    """0x30: the parameters in use (RAM)."""
    return bytes([0x30, 0]) + motor.pid


def write_pid_ram(motor, data):
    """0x31: lost when the power is turned off."""
    motor.pid = data[2:8]
    return data


def write_pid_rom(motor, data):
    """0x32: kept when the power is turned off; in use at once (HOLES 34)."""
    motor.rom.pid = motor.pid = data[2:8]
    return data


def read_accel(motor, data):
    """0x33: int32, 1 dps/s."""
    return struct.pack("<B3xi", 0x33, motor.accel)


def write_accel(motor, data):
    """0x34: RAM only."""
    motor.accel = struct.unpack_from("<i", data, 4)[0]
    return data


def read_encoder(motor, data):
    """0x90: position, original position, offset."""
    return struct.pack("<BxHHH", 0x90, motor.encoder(), motor.encoder_raw(), motor.offset)


def write_encoder_offset(motor, data):
    """0x91: new encoder offset (HOLES 35)."""
    offset = struct.unpack_from("<H", data, 6)[0] % motor.counts
    motor.offset = motor.rom.offset = offset
    return struct.pack("<B5xH", 0x91, offset)


def write_zero_rom(motor, data):
    """0x19: takes effect after the next power-on."""
    return struct.pack("<B5xH", 0x19, motor.zero_to_rom())


def read_multi_turn(motor, data):
    """0x92: int64 of which the low 7 bytes are sent, 0.01 degree."""
    angle = int(round(motor.multi_angle() * 100))
    return bytes([0x92]) + angle.to_bytes(8, "little", signed=True)[:7]


def read_single_turn(motor, data):
    """0x94: uint16, 0.01 degree, from the encoder zero."""
    return struct.pack("<B5xH", 0x94, int(round(motor.circle_angle() * 100)) % 36000)


def motor_off(motor, data):
    """0x80."""
    motor.off()
    return data


def motor_stop(motor, data):
    """0x81."""
    motor.stop()
    return data


def motor_running(motor, data):
    """0x88."""
    motor.resume()
    return data


def read_status_1(motor, data):
    """0x9A."""
    return status_1_reply(motor)


def clear_error(motor, data):
    """0x9B; the reply's table says its first byte is 0x9A (HOLES 37)."""
    motor.clear_error()
    return status_1_reply(motor)


def read_status_2(motor, data):
    """0x9C."""
    return motion_reply(motor, 0x9C)


def read_status_3(motor, data):
    """0x9D: phase currents, 1A/64LSB."""
    currents = [clamp16(i * PHASE_PER_AMPERE) for i in motor.phase_currents()]
    return struct.pack("<Bxhhh", 0x9D, *currents)


def torque_control(motor, data):
    """0xA1: iqControl int16."""
    motor.run_torque(struct.unpack_from("<h", data, 4)[0] / IQ_COMMAND_PER_AMPERE)
    return motion_reply(motor, 0xA1)


def speed_control(motor, data):
    """0xA2: speedControl int32, 0.01 dps."""
    motor.run_speed(struct.unpack_from("<i", data, 4)[0] / 100.0)
    return motion_reply(motor, 0xA2)


def position_control_1(motor, data):
    """0xA3: multi-turn angle int32, 0.01 degree."""
    motor.run_position(struct.unpack_from("<i", data, 4)[0] / 100.0)
    return motion_reply(motor, 0xA3)


def position_control_2(motor, data):
    """0xA4: maxSpeed uint16 1 dps, then as 0xA3."""
    speed, angle = struct.unpack_from("<Hi", data, 2)
    motor.run_position(angle / 100.0, float(speed))
    return motion_reply(motor, 0xA4)


def position_control_3(motor, data):
    """0xA5: spinDirection uint8, single-turn angle uint16."""
    angle = struct.unpack_from("<H", data, 4)[0]
    motor.run_single_turn(angle / 100.0, data[1] != 0)
    return motion_reply(motor, 0xA5)


def position_control_4(motor, data):
    """0xA6: spinDirection, maxSpeed, single-turn angle."""
    speed, angle = struct.unpack_from("<HH", data, 2)
    motor.run_single_turn(angle / 100.0, data[1] != 0, float(speed))
    return motion_reply(motor, 0xA6)


# Chapter 2, "Control Command list", in its order
COMMANDS = {
    0x30: read_pid,
    0x31: write_pid_ram,
    0x32: write_pid_rom,
    0x33: read_accel,
    0x34: write_accel,
    0x90: read_encoder,
    0x91: write_encoder_offset,
    0x19: write_zero_rom,
    0x92: read_multi_turn,
    0x94: read_single_turn,
    0x9A: read_status_1,
    0x9B: clear_error,
    0x9C: read_status_2,
    0x9D: read_status_3,
    0x80: motor_off,
    0x81: motor_stop,
    0x88: motor_running,
    0xA1: torque_control,
    0xA2: speed_control,
    0xA3: position_control_1,
    0xA4: position_control_2,
    0xA5: position_control_3,
    0xA6: position_control_4,
}


class Bus:
    """All motors on one CAN bus."""

    def __init__(self, motors):
        self.motors = motors        # ID -> RmdMotor
        self.clock = None

    def tick(self, now):
        """Bring the models up to `now`."""
        gap = 0.0 if self.clock is None else min(now - self.clock, LONGEST_GAP)
        self.clock = now
        steps = max(1, int(gap / STEP + 0.999))
        for _ in range(steps if gap > 0 else 0):
            for motor in self.motors.values():
                motor.advance(gap / steps)

    def __call__(self, can_id, data):
        """One standard data frame from the host; returns the reply frames."""
        if len(data) != 8:
            return []               # chapter 1: DLC is 8 byte
        if can_id == MULTI_ID:
            return self._multi(data)
        motor = self.motors.get(can_id - SINGLE_BASE)
        command = COMMANDS.get(data[0])
        if motor is None or command is None:
            return []
        return [(can_id, command(motor, data))]

    def _multi(self, data):
        """Chapter 4: one iqControl for each of the motors 1 to 4."""
        replies = []
        for number, iq in enumerate(struct.unpack("<4h", data), 1):
            motor = self.motors.get(number)
            if motor:
                motor.run_torque(iq / IQ_COMMAND_PER_AMPERE)
                replies.append((SINGLE_BASE + number, motion_reply(motor, 0xA1)))
        return replies

    def run_command(self, words):
        """Back door: volts ID V | celsius ID C | power ID | status ID."""
        motor = self.motors[int(words[1])]
        if words[0] == "volts":
            motor.volts = min(6553.5, max(0.0, float(words[2])))
        elif words[0] == "celsius":
            motor.celsius = min(127.0, max(-128.0, float(words[2])))
        elif words[0] == "power":
            motor.power_up()
        elif words[0] == "status":
            return "mode %s speed %.2f angle %.2f error %d" % (
                motor.mode, motor.speed, motor.multi_angle(), motor.error)
        else:
            raise ValueError(words[0])
        motor.advance(1e-6)         # protections see the new value at once
        return "ok"


def parse_arguments():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--listen", default="127.0.0.1:0", metavar="HOST:PORT")
    parser.add_argument("--control", metavar="HOST:PORT", help="back door for test benches")
    parser.add_argument("--ids", default="1,2", help="motor IDs, 1..32 (default: %(default)s)")
    parser.add_argument("--sent-reply", choices=("z", "cr"), default="z",
                        help="answer to a sent frame: z\\r or \\r")
    parser.add_argument("--encoder-bits", type=int, default=14, choices=range(12, 17))
    parser.add_argument("--max-speed", type=float, default=1440.0, help="dps")
    parser.add_argument("--max-current", type=float, default=20.0, help="A")
    parser.add_argument("--max-angle", type=float, default=0.0, help="degrees, 0 = none")
    args = parser.parse_args()
    args.ids = [int(n) for n in args.ids.split(",")]
    if not all(1 <= n <= 32 for n in args.ids):
        parser.error("IDs are 1 to 32 (chapter 1)")
    return args


def main():
    """Build the motors and serve them."""
    args = parse_arguments()
    limits = Limits(args.max_speed, args.max_current, args.max_angle)
    bus = Bus({n: RmdMotor(limits, args.encoder_bits) for n in args.ids})
    bus.tick(time.monotonic())
    adapter = Adapter(bus, args.sent_reply)
    LineServer(adapter, bus.tick, args.listen, args.control, bus.run_command).run()


if __name__ == "__main__":
    main()
