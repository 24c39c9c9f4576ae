"""Captures for the tests of the dissector: pcapng files of a CAN bus and of a serial line."""

import struct

SOCKETCAN, COOKED, RTAC_SERIAL, USER0 = 227, 113, 250, 147
INBOUND, OUTBOUND = 1, 2
REMOTE, EXTENDED = 0x4000_0000, 0x8000_0000


def block(kind, body):
    body += bytes(-len(body) % 4)
    size = len(body) + 12
    return struct.pack("<II", kind, size) + body + struct.pack("<I", size)


class Capture:
    """A file with interfaces of these link types. Packets are 1 ms apart unless they have a time."""

    def __init__(self, *link_types):
        self.blocks = [block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))]
        self.blocks += [block(1, struct.pack("<HHI", kind, 0, 0)) for kind in link_types]
        self.us = 1_700_000_000_000_000
        self.count = 0

    def packet(self, data, sent=None, after_ms=1, interface=0):
        """Adds a packet and returns its number."""
        self.us += int(after_ms * 1000)
        head = struct.pack("<IIIII", interface, self.us >> 32, self.us & 0xFFFF_FFFF, len(data), len(data))
        data += bytes(-len(data) % 4)
        if sent is not None:
            data += struct.pack("<HHIHH", 2, 4, OUTBOUND if sent else INBOUND, 0, 0)
        self.blocks.append(block(6, head + data))
        self.count += 1
        return self.count

    def can(self, identifier, data, sent=None, fd=False, **place):
        head = struct.pack(">IBBBB", identifier, len(data), 4 if fd else 0, 0, 0)
        return self.packet(head + data, sent, **place)

    def cooked_can(self, identifier, data, sent, **place):
        """A frame as the interface `any` of Linux captures it."""
        head = struct.pack(">HHH8sH", 4 if sent else 0, 280, 0, b"", 0x000C)
        return self.packet(head + struct.pack("<IBBBB", identifier, len(data), 0, 0, 0) + data, **place)

    def serial(self, data, sent, **place):
        """A packet of RTAC_SERIAL: its header has the direction."""
        seconds, us = divmod(self.us, 1_000_000)
        return self.packet(struct.pack(">IIBBH", seconds, us, 1 if sent else 2, 0, 0) + data, **place)

    def write(self, path):
        path.write_bytes(b"".join(self.blocks))
        return path
