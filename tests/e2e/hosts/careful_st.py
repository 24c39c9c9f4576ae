"""Reads the speed of motor 1 and believes nothing. It ends at the first error, as 4.1 says."""

import sys
import time

import serial

ACK, NACK = 0xF0, 0xFF


def checksum(data):
    total = sum(data)
    return (total >> 8) + total & 0xFF


def exchange(port, request, timeout):
    """The payload of the ACK to a request."""
    if port.in_waiting:
        sys.exit("received bytes without a request")
    port.write(request + bytes([checksum(request)]))
    reply, deadline = b"", time.monotonic() + timeout
    while len(reply) < 2 or len(reply) < reply[1] + 3:
        port.timeout = max(0, deadline - time.monotonic())
        reply += port.read(max(1, port.in_waiting))
        if time.monotonic() >= deadline:
            sys.exit(f"no reply, only {reply.hex(' ')!r}")
        if reply and reply[0] not in (ACK, NACK) or len(reply) > 1 and reply[1] > 128:
            sys.exit(f"no reply begins like this: {reply.hex(' ')}")
    if len(reply) > reply[1] + 3 or checksum(reply[:-1]) != reply[-1]:
        sys.exit(f"not one whole reply: {reply.hex(' ')}")
    if reply[0] == NACK:
        sys.exit(f"the drive refuses: {reply[2:-1].hex()}")
    return reply[2:-1]


port = serial.Serial(sys.argv[1], 115200)
for _ in range(4):
    value = exchange(port, bytes([0x22, 0x01, 0x1E]), float(sys.argv[2]))
    if len(value) not in (1, 2, 4):
        sys.exit(f"no register has {len(value)} bytes")
    print(int.from_bytes(value, "little", signed=True), "rpm", flush=True)
