"""Sends a line to a drive's back door: `back_door.py HOST:PORT fault 1 2 on`."""

import socket
import sys

host, _, port = sys.argv[1].rpartition(":")
with socket.create_connection((host, int(port)), timeout=5) as door:
    door.sendall(" ".join(sys.argv[2:]).encode() + b"\n")
    print(door.makefile().readline().strip())
