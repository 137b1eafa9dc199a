"""Program of a loop in real time on the virtual segment, for tests of the dashboard.

usage: loop_program.py SHARE AXES [jog] [still] [modes] [NAME,NAME,...]

"modes": accept the mode "stand" and the preset "wave", refuse "balance", and never answer "dance".
Names with a comma name the axes.
"""

from __future__ import annotations

import math
import sys
import time

import catenary as cat
from catenary.virtual import Segment, Servo

MODES = {"damping": "hold softly", "stand": "", "balance": ""}


def answer(share: cat.Share, request: cat.share.OperatorRequest) -> None:
    if request.name == "balance":
        request.refuse("the robot has fallen")
    elif request.name != "dance" and request.accept() and request.kind == "mode":
        share.mode = request.name


def main(name: str, axes: str, *options: str) -> None:
    offered = {"modes": MODES, "presets": ("wave", "dance")} if "modes" in options else {}
    share = cat.Share(name, jog="jog" in options, **offered)
    names = next((each.strip(",").split(",") for each in options if "," in each), None)
    segment = Segment([Servo() for _ in range(int(axes))])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=5.0, names=names)
        stop = cat.StopPolicy(on_axis_stopped="event")
        with share, cat.Loop(arm, sink=share, stop=stop) as loop:
            begin = time.monotonic()
            still = "still" in options
            for cycle in loop:
                if not still and cycle.number < 60_000:
                    arm.target.position[:] = 0.1 * math.sin(cycle.time)
                for request in share.requests():
                    answer(share, request)
                time.sleep(max(0.0, begin + cycle.number * 1e-3 - time.monotonic()))
                if cycle.number == 20:
                    print("running", flush=True)


main(*sys.argv[1:])
