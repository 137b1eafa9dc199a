"""Three drives follow a sine: `python three_drives.py eth0`, or `virtual` without hardware."""

import math
import sys

import catenary as cat

with cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)  # [rad/s]
    with cat.Loop(arm, period=1e-3) as loop:  # → OP, drives enabled and holding
        home = arm.actual.position.copy()  # [rad], one per axis
        for cycle in loop:
            arm.target.position[:] = home + 0.1 * math.sin(cycle.time)
            if cycle.time > 10.0:
                break  # leaving the block stops the drives, on any exit
    print(loop.timing)
