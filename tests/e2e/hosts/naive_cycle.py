"""Reads the angles of motors 1 to 4: four requests, and the replies in the same order."""

import sys

import can

MOTORS = range(1, 5)

bus = can.Bus(interface="slcan", channel=sys.argv[1], bitrate=1_000_000, sleep_after_open=0)
for _ in range(4):
    for motor in MOTORS:
        request = [0x92, 0, 0, 0, 0, 0, 0, 0]
        bus.send(can.Message(arbitration_id=0x140 + motor, data=request, is_extended_id=False))
    for motor in MOTORS:
        reply = bus.recv(float(sys.argv[2]))
        if reply is None:
            print("no reply")
            continue
        print(motor, int.from_bytes(reply.data[1:], "little", signed=True) / 100)
bus.shutdown()
