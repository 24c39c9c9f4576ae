"""Streams references to RMD motor 1 of a node until it is killed: ADDRESS NODE DEADLINE MOTION."""

import struct
import sys
import time

import bench  # noqa: F401  the folder of the programs of the tests

from fleeting import Member

address, node, deadline, motion = sys.argv[1:]
member = Member(address, node, who="commander", deadline=float(deadline), motion=float(motion))
member.lives()
first = True
while True:
    speed = struct.pack("<i", 36000)
    answer = member.command(0xA2, 0, 0, 0, *speed, line="rmd0", motor=1)
    if first and answer["kind"] == "answer":
        first = False
        print("streams", flush=True)
    time.sleep(0.05)
