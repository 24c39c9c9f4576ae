"""Reads SPEED_MEAS of motor 1 with care, but stops the kit for longer than it waits for a reply.

    freezing_st.py PATH WAIT [MARK]      with MARK, a file, only until that exists
"""

import os
import signal
import sys
import time

import serial

GET_SPEED_MEAS = bytes([0x22, 0x01, 0x1E, 0x41])
wait = float(sys.argv[2])
freezes = len(sys.argv) < 4 or not os.path.exists(sys.argv[3])
if freezes and len(sys.argv) > 3:
    open(sys.argv[3], "w").close()

line = serial.Serial(sys.argv[1], 115_200, timeout=wait)
for reading in range(4):
    line.reset_input_buffer()
    if freezes and reading == 1:
        os.kill(os.getppid(), signal.SIGSTOP)
        line.write(GET_SPEED_MEAS)
        time.sleep(1.5 * wait)
        print("no reply")
        line.write(GET_SPEED_MEAS)
        os.kill(os.getppid(), signal.SIGCONT)
        # Both replies come now; which is which a host cannot know.
        time.sleep(wait)
        print("no reply")
        continue
    line.write(GET_SPEED_MEAS)
    reply = line.read(7)
    print(int.from_bytes(reply[2:6], "little", signed=True) if len(reply) == 7 else "no reply")
