"""A request that changes a motion makes the motor that of its sender, also one that another started.

Here are requests of each form. crates/sim/tests/sim/motion.rs shows that the tables name all of them.
"""

import os
import socket
import struct

import pytest

from guarded import is_told_to_stop
from lines import RawLine
from program import eventually
from st_wire import EXECUTE, SET_RAMP, SET_REG, frame, header

RUNS = int(os.environ.get("OWNER_RUNS", "1"))
START = 1
#: Frame code and payload.
ST = {
    "SET_RAMP": (SET_RAMP, struct.pack("<iH", 500, 500)),
    "STOP_RAMP": (EXECUTE, b"\x03"),
    "TORQUE_REF": (SET_REG, b"\x08" + struct.pack("<h", 500)),
}
#: Identifier and data: a torque, and torques for four motors.
RMD = {"0xA1": (0x141, b"\xa1" + struct.pack("<xxxhxx", 100)), "torque4": (0x280, struct.pack("<hhhh", 100, 0, 0, 0))}


class Drive:
    """An ST drive whose motor is started before a guard or a share holds its port."""

    def __init__(self, drives):
        self.drives = drives

    def turns(self):
        """It turns, in speed control, for a program that has ended."""
        eventually(lambda: self.drives.motor(1)["status"] == "IDLE", "the motor rests", within=20)
        with RawLine(self.drives.st) as line:
            line.say(frame(header(SET_RAMP, 1), struct.pack("<iH", 1000, 0)), b"\xf0")
            line.say(frame(header(EXECUTE, 1), [START]), b"\xf0")
        eventually(lambda: self.drives.motor(1)["status"] == "RUN", "the motor turns", within=20)

    def stops(self, name):
        eventually(lambda: is_told_to_stop(self.drives, "st"), f"the stop after {name}", within=20)


@pytest.fixture
def drive(sim):
    return Drive(sim(rmd=()))


def test_a_guard_stops_a_motor_whose_motion_its_program_changed(drive, guard):
    for name, (code, payload) in RUNS * list(ST.items()):
        drive.turns()
        process = guard("st", drive.drives)
        with RawLine(process.port) as line:
            line.say(frame(header(code, 1), payload), b"\xf0", b"\xff")
        drive.stops(name)
        process.end()


def test_a_signal_to_a_guard_stops_a_motor_whose_motion_its_program_changed(drive, guard):
    for _ in range(RUNS):
        drive.turns()
        process = guard("st", drive.drives)
        with RawLine(process.port) as line:
            line.say(frame(header(SET_RAMP, 1), struct.pack("<iH", 1500, 100)), b"\xf0")
            process.process.terminate()
            assert process.wait() == 0
        drive.stops("SIGTERM of the guard")


def test_rmd_motors_whose_motion_a_program_changed_stop(sim, start, tmp_path):
    drives = sim(st=(), rmd=("tcp",))
    host, _, port = drives.can_address.rpartition(":")
    other = socket.create_connection((host, int(port)), 10)
    other.sendall(b"\rC\rS8\rO\r")
    port = f"slcan:tcp:{drives.can_address}"
    start("guard", "rmd", "-p", port, "--serve", f"slcan-pty:{tmp_path}/held").line(0)
    for name, (identifier, data) in RUNS * list(RMD.items()):

        def turns():
            # The stop of the program before may be repeated until it is confirmed.
            other.sendall(b"t1418A2000000A08C0000\r")
            return drives.motor(1)["mode"] == "speed"

        eventually(turns, "the motor turns")
        with RawLine(tmp_path / "held") as line:
            line.say(b"\rC\rS8\rO\r", b"\r")
            line.say(f"t{identifier:03X}8{data.hex().upper()}\r".encode(), b"t1418")
        eventually(lambda: is_told_to_stop(drives, "rmd"), f"the stop after {name}")
