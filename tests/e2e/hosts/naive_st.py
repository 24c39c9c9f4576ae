"""Reads the speed of motor 1, as people write it in the first minute: seven bytes out of the line."""

import struct
import sys

import serial

port = serial.Serial(sys.argv[1], 115200, timeout=float(sys.argv[2]))
for _ in range(4):
    port.write(bytes([0x22, 0x01, 0x1E, 0x41]))  # GET_REG, motor 1, SPEED_MEAS
    reply = port.read(7)
    if len(reply) < 7:
        print("no reply")
        continue
    print(struct.unpack("<i", reply[2:6])[0])
