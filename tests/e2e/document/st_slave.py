#!/usr/bin/env python3
"""A drive (slave) of ST's serial Motor Control Protocol, behind a TCP port.

    python3 st_slave.py --listen 127.0.0.1:0

Paragraph numbers are those of the document "Motor Control Protocol";
"HOLES n" are the entries of HOLES.md.
"""
import argparse
import struct
import time

import st_drive
import st_frames as f
from st_access import read_register, write_register
from tcpline import LineServer

SDK_NAME = b"ST MC SDK"
STEP = 0.002                # longest step of the model, seconds
LONGEST_GAP = 5.0           # more real time than this at once is not made up

# Table 4: Cmd ID -> method of Motor.  These never fail.
COMMANDS = {
    0x01: st_drive.Motor.start,
    0x02: st_drive.Motor.stop,
    0x03: st_drive.Motor.stop_ramp,
    0x06: st_drive.Motor.start_stop,
    0x07: st_drive.Motor.fault_ack,
    0x08: st_drive.Motor.encoder_align,
    0x09: st_drive.Motor.iqdref_clear,
}

# Table 4: these succeed "unless the PFC feature has not been configured".
PFC_COMMANDS = {
    0x0A: st_drive.Motor.pfc_enable,
    0x0B: st_drive.Motor.pfc_disable,
    0x0C: st_drive.Motor.pfc_fault_ack,
}


class Drive:
    """All motors, the current one, and one handler per frame code."""

    def __init__(self, motors, version, read_d=True):
        self.motors = motors
        self.current = 1            # 3.2: at startup the current motor is motor 1
        self.version = version
        self.read_d = read_d
        self.clock = None

    def motor(self):
        """The current motor."""
        return self.motors[self.current - 1]

    def tick(self, now):
        """Bring the model up to `now`."""
        gap = 0.0 if self.clock is None else min(now - self.clock, LONGEST_GAP)
        self.clock = now
        steps = max(1, int(gap / STEP + 0.999))
        for _ in range(steps if gap > 0 else 0):
            for motor in self.motors:
                motor.advance(gap / steps)

    def answer(self, frame):
        """4.1: checksum, then Motor#, then Frame Code, then the message."""
        try:
            return f.ack(self._process(frame))
        except f.Nack as error:
            return f.nack(error.code)

    def _process(self, frame):
        header, length, payload = frame[0], frame[1], frame[2:-1]
        if f.checksum(frame[:-1]) != frame[-1]:
            raise f.Nack(f.BAD_CRC)
        if length > f.MAX_PAYLOAD:
            raise f.Nack(f.WRONG_SET)           # HOLES 3
        self._select_motor(header >> 5)
        handler = HANDLERS.get(header & 0x1F)
        if handler is None:
            raise f.Nack(f.BAD_FRAME_ID)
        return handler(self, payload) or b""

    def _select_motor(self, number):
        """3.2: 0 = current motor; 1..N becomes the current motor; else error."""
        if number > len(self.motors):
            raise f.Nack(f.BAD_MOTOR_SELECTED)
        if number:
            self.current = number

    # ---- one method per frame code --------------------------------------

    def set_register(self, payload):
        """4.4: Reg ID, Reg Value."""
        if not payload:
            raise f.Nack(f.SET_READ_ONLY)
        write_register(self, self.motor(), payload[0], payload[1:])

    def get_register(self, payload):
        """4.5: Reg ID."""
        if not payload:
            raise f.Nack(f.GET_WRITE_ONLY)
        return read_register(self, self.motor(), payload[0])

    def execute_command(self, payload):
        """4.6: Cmd ID."""
        command = payload[0] if payload else None
        if command in PFC_COMMANDS and self.motor().has_pfc:
            PFC_COMMANDS[command](self.motor())
        elif command in COMMANDS:
            COMMANDS[command](self.motor())
        else:
            raise f.Nack(f.WRONG_CMD)

    def get_board_info(self, _payload):
        """4.7: major, minor, patch, name; 32 bytes."""
        numbers = [int(n) for n in self.version.split("-")[0].split(".")]
        return (bytes(numbers) + SDK_NAME).ljust(32, b"\0")

    def set_ramp(self, payload):
        """4.8: Final Speed s32 RPM, Duration u16 ms.  Never fails (HOLES 13)."""
        if len(payload) >= 6:
            speed, duration = struct.unpack_from("<iH", payload)
            self.motor().set_ramp(speed, duration / 1000.0)

    def get_revup_data(self, payload):
        """4.9: Phase -> Target Speed s32, Target Torque s16, Duration u16."""
        revup = self.motor().revup
        phase = payload[0] if payload else 0
        row = revup[phase] if phase < len(revup) else (0, 0, 0)     # HOLES 14
        return struct.pack("<ihH", *row)

    def set_revup_data(self, payload):
        """4.10: Phase, Target Speed, Target Torque, Duration.  Never fails."""
        if len(payload) >= 9 and payload[0] < st_drive.REVUP_PHASES:
            self.motor().revup[payload[0]] = struct.unpack_from("<ihH", payload, 1)

    def set_current_ref(self, payload):
        """4.11: Iq reference s16, Id reference s16.  Never fails."""
        if len(payload) >= 4:
            self.motor().set_current_ref(*struct.unpack_from("<hh", payload))

    def get_fw_version(self, _payload):
        """4.12: "Name<TAB>Ver.MAJOR.MINOR.PATCH[-TYPE INCREMENT]", 32 bytes."""
        text = SDK_NAME + b"\tVer." + self.version.encode("ascii")
        return text[:31].ljust(32, b"\0")

    # ---- back door ------------------------------------------------------

    def run_command(self, words):
        """fault|pfc-fault MOTOR MASK on|off -- and: status MOTOR."""
        motor = self.motors[int(words[1]) - 1]
        if words[0] == "fault":
            motor.set_fault(int(words[2], 0), words[3] == "on")
        elif words[0] == "pfc-fault":
            motor.set_pfc_fault(int(words[2], 0), words[3] == "on")
        elif words[0] == "status":
            return "state %d speed %.1f ref %.1f" % (motor.state, motor.speed, motor.speed_ref)
        else:
            raise ValueError(words[0])
        return "ok"


# Table 1: Frame Code -> handler (0x0D and 0x0E: HOLES 5)
HANDLERS = {
    f.SET_REG: Drive.set_register,
    f.GET_REG: Drive.get_register,
    f.EXECUTE_CMD: Drive.execute_command,
    f.GET_BOARD_INFO: Drive.get_board_info,
    f.SET_RAMP: Drive.set_ramp,
    f.GET_REVUP_DATA: Drive.get_revup_data,
    f.SET_REVUP_DATA: Drive.set_revup_data,
    f.SET_CURRENT_REF: Drive.set_current_ref,
    f.GET_FW_VERSION: Drive.get_fw_version,
}


class SerialSession:
    """The end of the serial line: bytes to frames, frames to answers."""

    def __init__(self, drive, timeout):
        self.drive = drive
        self.reader = f.FrameReader(timeout)

    def open(self):
        """A new client: no half frame is left from the last one."""
        self.reader.clear()

    close = open

    def receive(self, data, now):
        """Answer every frame that is complete."""
        return b"".join(map(self.drive.answer, self.reader.feed(data, now)))

    def deadline(self):
        """End of the 25 ms of the frame under way (4.1)."""
        return self.reader.deadline()

    def expire(self, _now):
        """4.1: not fully received in time: NACK TIMEOUT ends the exchange."""
        self.reader.clear()
        return f.nack(f.TIMEOUT)


def parse_arguments():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--listen", default="127.0.0.1:0", metavar="HOST:PORT")
    parser.add_argument("--control", metavar="HOST:PORT", help="back door for test benches")
    parser.add_argument("--motors", type=int, default=2, choices=range(1, 8))
    parser.add_argument("--sensors", default="pll,encoder",
                        help="any of pll,cordic,encoder,hall (default: %(default)s)")
    parser.add_argument("--pfc", default="", help="motors with a PFC, e.g. 1 or 1,2")
    parser.add_argument("--d-access", choices=("read", "none"), default="read",
                        help="may GET_REG read registers with access D?")
    parser.add_argument("--max-speed", type=int, default=4000, help="RPM")
    parser.add_argument("--target", type=int, default=1500,
                        help="final speed of the first start, RPM")
    parser.add_argument("--version-string", default="5.4.3", help="e.g. 5.4.3-RC1")
    parser.add_argument("--frame-timeout-ms", type=float, default=25.0)
    return parser.parse_args()


def main():
    """Build the drive and serve it."""
    args = parse_arguments()
    sensors = [s for s in args.sensors.split(",") if s]
    pfc = {int(n) for n in args.pfc.split(",") if n}
    motors = [st_drive.Motor(sensors, n in pfc, args.max_speed, args.target)
              for n in range(1, args.motors + 1)]
    drive = Drive(motors, args.version_string, args.d_access == "read")
    drive.tick(time.monotonic())
    session = SerialSession(drive, args.frame_timeout_ms / 1000.0)
    LineServer(session, drive.tick, args.listen, args.control, drive.run_command).run()


if __name__ == "__main__":
    main()
