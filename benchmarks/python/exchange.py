"""Exchanges per second through Python, measured for `make bench`.

    python benchmarks/python/exchange.py RESPONDER ROUNDS EXCHANGES

``RESPONDER respond N`` prints the paths of N ptys and answers on them at once, always the same, until its
standard input ends. Every contestant reads SPEED_MEAS of motor 1. The first line of output lists the packages,
and says in ns what encoding, checking and decoding alone cost; each further line is a round in which each
contestant had its turn: exchanges per second, and the processor time that one takes at this end. All run on
one core, with the responder, where a wake-up costs the same every time.
"""

import asyncio
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
import time
import timeit

import serial

import motorlink

REQUEST = bytes([0x22, 0x01, 0x1E, 0x41])
REPLY = bytes([0xF0, 0x04, 0, 0, 0, 0, 0xF4])
REPLY_SIZE = len(REPLY)
BUSES = 4


class DriveError(Exception):
    """The drive refused."""


class LineError(Exception):
    """No reply can be trusted."""


#: Number, size in bytes and sign of registers.
REGISTERS = {
    "STATUS": (0x02, 1, False),
    "SPEED_KP": (0x05, 2, True),
    "BUS_VOLTAGE": (0x19, 2, False),
    "SPEED_MEAS": (0x1E, 4, True),
}


def checksum(data):
    total = sum(data)
    return (total & 0xFF) + (total >> 8) & 0xFF


class PlainPython:
    """One exchange as a careful program of a page has it: framing, checks, errors."""

    def __init__(self, line):
        self.line = line

    def read(self, motor, name):
        number, size, signed = REGISTERS[name]
        payload = self.exchange(motor, 0x02, bytes([number]))
        if len(payload) != size:
            raise LineError(f"{name} has {size} bytes, not {len(payload)}")
        return int.from_bytes(payload, "little", signed=signed)

    def exchange(self, motor, code, payload):
        if not 0 <= motor <= 7 or not 0 <= code <= 31 or len(payload) > 128:
            raise ValueError("no such frame")
        frame = bytes([motor << 5 | code, len(payload)]) + payload
        self.line.write(frame + bytes([checksum(frame)]))
        head = self.line.read(2)
        if len(head) < 2:
            raise LineError("no reply in time")
        if head[0] not in (0xF0, 0xFF):
            self.line.reset_input_buffer()
            raise LineError(f"a reply does not begin with {head[0]:#04x}")
        rest = self.line.read(head[1] + 1)
        if len(rest) < head[1] + 1:
            raise LineError("the reply is not complete")
        if checksum(head + rest[:-1]) != rest[-1]:
            self.line.reset_input_buffer()
            raise LineError("the checksum is wrong")
        if head[0] == 0xFF:
            raise DriveError(f"the drive refused: {rest[0]:#04x}")
        return rest[:-1]


# recovery="none": the responder answers one request only, not the questions on a line that was just opened.
def blocking(path):
    motor = motorlink.st.open(path, recovery="none").motor(1)

    def run(exchanges):
        for _ in range(exchanges):
            motor.get("SPEED_MEAS")

    return run


def system_calls(path):
    """What no program in Python is faster than."""
    line = os.open(path, os.O_RDWR | os.O_NOCTTY)

    def run(exchanges):
        for _ in range(exchanges):
            os.write(line, REQUEST)
            received = len(os.read(line, REPLY_SIZE))
            while received < REPLY_SIZE:
                received += len(os.read(line, REPLY_SIZE - received))

    return run


def bytes_only(path):
    line = serial.Serial(path, 115200, timeout=1)

    def run(exchanges):
        for _ in range(exchanges):
            line.write(REQUEST)
            line.read(REPLY_SIZE)

    return run


def plain_python(path):
    drive = PlainPython(serial.Serial(path, 115200, timeout=1))

    def run(exchanges):
        for _ in range(exchanges):
            drive.read(1, "SPEED_MEAS")

    return run


def awaited(*paths):
    """As many exchanges on all buses together."""
    loop = asyncio.new_event_loop()

    async def opened():
        return [(await motorlink.aio.st.open(path, recovery="none")).motor(1) for path in paths]

    motors = loop.run_until_complete(opened())

    async def read(motor, exchanges):
        for _ in range(exchanges):
            await motor.get("SPEED_MEAS")

    async def all_of_them(exchanges):
        await asyncio.gather(*(read(motor, exchanges // len(motors)) for motor in motors))

    return lambda exchanges: loop.run_until_complete(all_of_them(exchanges))


class Memory:
    """A line that has the reply already."""

    def write(self, data):
        self.left = REPLY

    def read(self, size):
        taken, self.left = self.left[:size], self.left[size:]
        return taken


def without_a_line():
    """What an exchange costs but for the line, ns, least of some tries."""
    request, drive = motorlink.st.Request.get_register("SPEED_MEAS"), PlainPython(Memory())

    def ours():
        request.encode(1)
        request.decode_reply(REPLY)

    count = 20_000
    least = {
        name: min(timeit.repeat(work, number=count, repeat=15)) / count * 1e9
        for name, work in (("motorlink", ours), ("plain python", lambda: drive.read(1, "SPEED_MEAS")))
    }
    return least


def measure(run, exchanges):
    """Exchanges per second, and the processor time that one takes at this end, us."""
    began, worked = time.perf_counter(), time.process_time()
    run(exchanges)
    worked, took = time.process_time() - worked, time.perf_counter() - began
    return {"rate": exchanges / took, "us": worked / exchanges * 1e6}


def main():
    responder, rounds, exchanges = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    answering = subprocess.Popen(
        [responder, "respond", str(5 + BUSES)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    paths = [answering.stdout.readline().strip() for _ in range(5 + BUSES)]
    contestants = {
        "motorlink": blocking(paths[0]),
        "bytes only": bytes_only(paths[1]),
        "plain python": plain_python(paths[2]),
        "system calls": system_calls(paths[3]),
        "asyncio": awaited(paths[4]),
        "asyncio, four": awaited(*paths[5:]),
    }
    versions = {name: importlib.metadata.version(name) for name in ("motorlink", "pyserial")}
    versions = {"Python": platform.python_version(), **versions}
    print(json.dumps({"versions": versions, "without a line": without_a_line()}))
    for run in contestants.values():
        run(exchanges)
    for _ in range(rounds):
        print(json.dumps({name: measure(run, exchanges) for name, run in contestants.items()}), flush=True)
    answering.stdin.close()
    answering.wait()


if __name__ == "__main__":
    main()
