"""Reads the angle of motor 1, as people write it in the first minute: the next frame is the reply."""

import sys

import can

bus = can.Bus(interface="slcan", channel=sys.argv[1], bitrate=1_000_000, sleep_after_open=0)
for _ in range(4):
    request = [0x92, 0, 0, 0, 0, 0, 0, 0]
    bus.send(can.Message(arbitration_id=0x141, data=request, is_extended_id=False))
    reply = bus.recv(float(sys.argv[2]))
    if reply is None:
        print("no reply")
        continue
    print(int.from_bytes(reply.data[1:], "little", signed=True) / 100)
bus.shutdown()
