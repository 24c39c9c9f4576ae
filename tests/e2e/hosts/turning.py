"""Turns a motor and stays: turning.py PROTOCOL PORT MODE. What it is given on stdin ends it.

PROTOCOL: st, rmd (slcan). PORT: a path of a pty, unix:PATH, or HOST:PORT. MODE: hold is silent after
that; poll reads again and again; flood writes faster than the line carries; command repeats the motion command.
"""

import os
import select
import socket
import sys
import termios
import tty

START = bytes([0x23, 0x01, 0x01, 0x25])
ST_QUESTION = bytes([0x22, 0x01, 0x1E, 0x41])
SPEED = b"t1418A2000000A08C0000\r"
RMD_QUESTION = b"t14189C00000000000000\r"


def opened(port):
    if port.startswith("unix:"):
        line = socket.socket(socket.AF_UNIX)
        line.connect(port.removeprefix("unix:"))
        return line.detach()
    if ":" in port:
        host, _, number = port.rpartition(":")
        return socket.create_connection((host, int(number))).detach()
    line = os.open(port, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(line, termios.TCSANOW)
    return line


def answered(line, beginning):
    """Reads until `beginning` came."""
    came = b""
    while beginning not in came:
        assert select.select([line], [], [], 20)[0], came
        received = os.read(line, 4096)
        if not received:
            raise OSError("the end of the line")
        came += received


protocol, port, mode = sys.argv[1:]
line = opened(port)
if protocol == "st":
    os.write(line, START)
    answered(line, bytes([0xF0, 0x00, 0xF0]))
    question, reply = ST_QUESTION, b"\xf0"
else:
    os.write(line, b"\rC\rS8\rO\r")
    os.write(line, SPEED)
    answered(line, b"t1418A2")
    question, reply = RMD_QUESTION, b"t1418"
print("turns", flush=True)
if mode == "command":
    question = START if protocol == "st" else SPEED
if mode == "hold":
    sys.stdin.read()
try:
    while True:
        if mode == "flood":
            os.write(line, question * 500)
            if select.select([line], [], [], 0)[0]:
                os.read(line, 65536)
        else:
            os.write(line, question)
            answered(line, reply)
except OSError:
    sys.exit("the line was closed")
