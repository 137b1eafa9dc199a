"""Program of a loop in real time on the virtual segment, for tests of the dashboard.

usage: loop_program.py SHARE AXES [jog]
"""

from __future__ import annotations

import math
import sys
import time

import catenary as cat
from catenary.virtual import Segment, Servo


def main(name: str, axes: str, *options: str) -> None:
    share = cat.Share(name, jog="jog" in options)
    segment = Segment([Servo() for _ in range(int(axes))])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=5.0)
        stop = cat.StopPolicy(on_axis_stopped="event")
        with share, cat.Loop(arm, sink=share, stop=stop) as loop:
            begin = time.monotonic()
            still = "still" in options
            for cycle in loop:
                if not still and cycle.number < 60_000:
                    arm.target.position[:] = 0.1 * math.sin(cycle.time)
                time.sleep(max(0.0, begin + cycle.number * 1e-3 - time.monotonic()))
                if cycle.number == 20:
                    print("running", flush=True)


main(*sys.argv[1:])
