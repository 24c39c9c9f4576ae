"""Every request that changes a motion makes the motor that of its sender, also one that another started."""

import json
import os
import socket
import struct
from functools import cache

import pytest

from guarded import is_told_to_stop
from lines import RawLine
from program import eventually
from sharing import Client
from st_wire import EXECUTE, SET_RAMP, SET_REG, frame, header

RUNS = int(os.environ.get("OWNER_RUNS", "1"))
START = 1


@cache
def spec(motorlink):
    return json.loads(os.popen(f"{motorlink} spec json").read())


def digits(row):
    """A value that the field may have, as bytes."""
    kind, size = row.get("type", "i"), row["bytes"]
    if kind == "f32":
        return struct.pack("<f", 1.0)
    return (1 if size == 1 else 500).to_bytes(size, "little")


def st_requests(motorlink, profile):
    """Frame code and payload of each request that changes a motion."""
    tables = spec(motorlink)["st"]
    for row in tables["commands"]:
        if row["moves"] and profile in row["profiles"]:
            yield row["name"], EXECUTE, bytes([row["number"]])
    for row in tables["frame_codes"]:
        if row["moves"] and profile in row["profiles"]:
            yield row["name"], row["number"], b"".join(map(digits, row["request"]["values"]))
    for row in tables["registers"]:
        size = row["profiles"].get(profile, {}).get("write_bytes")
        if row["moves"] and size:
            value = 0 if size == 1 else 500
            yield row["name"], SET_REG, bytes([row["id"]]) + value.to_bytes(size, "little")


def rmd_requests(motorlink):
    """Identifier and data of each request that changes a motion."""
    tables = spec(motorlink)["rmd"]
    for row in tables["commands"]:
        if row["moves"]:
            data = bytearray([row["code"], *bytes(7)])
            for field in row["request"]:
                data[field["byte"] : field["byte"] + field["bytes"]] = digits(field)
            yield row["name"], 0x141, bytes(data)
    torques = b"".join(map(digits, tables["torque4"]["request"]))
    yield "torque4", tables["torque4"]["identifier"], torques


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
    return lambda profile: Drive(sim("--profile", profile, rmd=()))


@pytest.mark.parametrize("profile", ["spec", "mcsdk-5.4"])
def test_a_guard_stops_a_motor_whose_motion_its_program_changed(motorlink, drive, guard, profile):
    turning = drive(profile)
    for name, code, payload in RUNS * list(st_requests(motorlink, profile)):
        turning.turns()
        process = guard("st", turning.drives)
        with RawLine(process.port) as line:
            line.say(frame(header(code, 1), payload), b"\xf0", b"\xff")
        turning.stops(name)
        process.end()


def test_a_signal_to_a_guard_stops_a_motor_whose_motion_its_program_changed(drive, guard):
    turning = drive("spec")
    for _ in range(RUNS):
        turning.turns()
        process = guard("st", turning.drives)
        with RawLine(process.port) as line:
            line.say(frame(header(SET_RAMP, 1), struct.pack("<iH", 1500, 100)), b"\xf0")
            process.process.terminate()
            assert process.wait() == 0
        turning.stops("SIGTERM of the guard")


@pytest.mark.parametrize("profile", ["spec", "mcsdk-5.4"])
def test_a_share_stops_a_motor_whose_motion_its_program_changed(motorlink, drive, start, tmp_path, profile):
    turning, answered = drive(profile), 0
    for name, code, payload in RUNS * list(st_requests(motorlink, profile)):
        turning.turns()
        share = start("share", "-p", turning.drives.st, "--profile", profile, "--at", f"unix:{tmp_path}/share", "--json")
        share.line(0)
        program = Client(tmp_path / "share", "program")
        answer = program.command("st0", 1, code, *payload)
        program.socket.close()
        answered += answer["kind"] == "answer"
        # What the drive refuses, or does not get on a busy machine, changes nothing.
        if answer.get("reason") in ("refused", "expired"):
            other = Client(tmp_path / "share", "other")
            assert other.ask("stop")["kind"] == "answer"
        turning.stops(name)
        share.end()
    assert answered >= 8 * RUNS


@pytest.mark.parametrize("path", ["guard", "share"])
def test_rmd_motors_whose_motion_a_program_changed_stop(motorlink, sim, start, tmp_path, path):
    drives = sim(st=(), rmd=("tcp",))
    host, _, port = drives.can_address.rpartition(":")
    other = socket.create_connection((host, int(port)), 10)
    other.sendall(b"\rC\rS8\rO\r")
    port = f"slcan:tcp:{drives.can_address}"
    if path == "guard":
        start("guard", "rmd", "-p", port, "--serve", f"slcan-pty:{tmp_path}/held").line(0)
    else:
        start("share", "-p", port, "--at", f"unix:{tmp_path}/share", "--json").line(0)
    for name, identifier, data in RUNS * list(rmd_requests(motorlink)):

        def turns():
            # The stop of the program before may be repeated until it is confirmed.
            other.sendall(b"t1418A2000000A08C0000\r")
            return drives.motor(1)["mode"] == "speed"

        eventually(turns, "the motor turns")
        if path == "guard":
            with RawLine(tmp_path / "held") as line:
                line.say(b"\rC\rS8\rO\r", b"\r")
                line.say(f"t{identifier:03X}8{data.hex().upper()}\r".encode(), b"t1418")
        elif identifier != 0x280:
            program = Client(tmp_path / "share", "program")
            sent = lambda: program.command("rmd0", 1, *data)  # noqa: E731
            eventually(lambda: sent()["kind"] == "answer", f"the answer to {name}")
            program.socket.close()
        else:
            continue
        eventually(lambda: is_told_to_stop(drives, "rmd"), f"the stop after {name}")
