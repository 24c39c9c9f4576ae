"""Reads the angles of motors 1 to 4 at once and believes nothing. It ends at the first error."""

import sys
import time

import can

MOTORS = range(1, 5)
ANGLE = 0x92


def cycle(bus, timeout):
    """The angle of each motor, in degrees."""
    while bus.recv(0):
        pass  # Nobody's answer: it came before the question.
    for motor in MOTORS:
        request = [ANGLE, 0, 0, 0, 0, 0, 0, 0]
        bus.send(can.Message(arbitration_id=0x140 + motor, data=request, is_extended_id=False))
    angles, deadline = {}, time.monotonic() + timeout
    while len(angles) < len(MOTORS):
        reply = bus.recv(max(0, deadline - time.monotonic()))
        if reply is None:
            sys.exit(f"only motors {sorted(angles)} answer")
        if reply.is_extended_id or reply.is_remote_frame or reply.dlc != 8:
            continue
        motor = reply.arbitration_id - 0x140
        if motor in MOTORS and reply.data[0] == ANGLE:
            angle = int.from_bytes(reply.data[1:], "little", signed=True) / 100
            angles.setdefault(motor, angle)
    return angles


bus = can.Bus(interface="slcan", channel=sys.argv[1], bitrate=1_000_000, sleep_after_open=0)
for _ in range(4):
    for motor, angle in sorted(cycle(bus, float(sys.argv[2])).items()):
        print(motor, angle, flush=True)
bus.shutdown()
