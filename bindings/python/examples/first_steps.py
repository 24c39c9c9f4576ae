"""First steps: drives of both protocols, simulated, or real ones.

    python first_steps.py                                   # simulated; needs nothing
    python first_steps.py /dev/ttyACM0 slcan:/dev/ttyACM1   # motors will turn!

Editors that support cells (`# %%`) can run them one by one.
"""

# %% Ports
# A bench has simulated drives on virtual time: nothing sleeps. A program opens it like a port.
import sys
import time

import motorlink

if len(sys.argv) > 2:
    st_port, rmd_port, wait = sys.argv[1], sys.argv[2], time.sleep
else:
    bench = motorlink.sim.Bench("[[st.motor]]\npreset = 'servo'")
    st_port, rmd_port, wait = bench, bench, bench.run

# %% An ST drive
# The end of `with` stops the motors that were started in it. So do an exception, Ctrl-C and SIGTERM.
with motorlink.st.open(st_port) as client:
    print("drive   ", client.board_info())
    motor = client.motor(1)
    motor.set_ramp(1000, 0.5)  # rpm, s
    motor.start()
    wait(3.0)
    print("status  ", motor.status())

    # Registers by name. Tab completes the names after `motor.registers.`.
    print("speed   ", motor.get("SPEED_MEAS"), motor.registers.info("SPEED_MEAS").unit)
    print("voltage ", motor.registers.BUS_VOLTAGE, "V")
    motor.registers.SPEED_KP = motor.registers.SPEED_KP + 10

    # A structured array: the time, and one column for each register.
    samples = client.sample(["SPEED_MEAS", "TORQUE_MEAS"], rate=100, seconds=0.5)
    speed = samples["SPEED_MEAS"]
    print(f"samples  {len(samples)}: {speed.mean():.0f} rpm, from {speed.min():.0f} to {speed.max():.0f}")

    # %% Errors
    # A refusal of the drive, a failed line and a value that cannot be sent are different exceptions.
    try:
        motor.set("SPEED_MEAS", 3)
    except motorlink.RefusedError as refused:
        print("refused ", refused.name)
    try:
        motor.get("SPED_MEAS")
    except motorlink.InvalidValueError as bad:
        print("bad     ", bad)

# %% RMD motors
# Angles are those of the motor shaft, over all turns. The exchanges of a cycle overlap.
with motorlink.rmd.open(rmd_port) as client:
    print("motors  ", [found.id for found in client.scan(range(1, 9))])
    first = client.motor(1)
    first.set_position(90, max_speed_dps=500)  # degrees, degrees per second
    wait(1.0)
    print(f"angle    {first.multi_turn_angle():.1f} degrees at {first.status().voltage_volts} V")
    answers = client.cycle({1: motorlink.rmd.set_speed(100), 2: motorlink.rmd.set_torque(0.2)})
    for number, answer in answers.items():
        print(f"motor {number}  {answer}")
    wait(0.5)
    print("speed   ", first.motion_status().speed_dps, "degrees per second")
