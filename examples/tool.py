"""A tool that may be unplugged and plugged in while the arm moves: `python tool.py eth0`.

Without an argument, the program uses the virtual segment of tool.toml, where the tool loses power
once. On your segment, the first device of the tool needs the alias 20: run `catenary alias eth0
POSITION 20`, then switch the device off and on.
"""

import sys
from pathlib import Path

import catenary as cat

HERE = Path(__file__).parent

with cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else f"virtual:{HERE}/tool.toml") as main:
    subs = main.scan()
    tool = subs.group(20)
    others = [drive for drive in subs.drives if drive not in tool]
    arm = cat.Drives(others, counts_per_turn=2**20, velocity_limit=2.0)
    grip = cat.Outputs(*tool, required=False)
    with cat.Loop(arm, grip, period=1e-3, stop=cat.StopPolicy(on_return="restore")) as loop:
        for cycle in loop:
            grip.bits[:] = cycle.number // 500 % 2
            for event in main.events:
                print(event)
            if cycle.time > 3.0:
                break
        print("the tool is", "present" if all(grip.present) else "missing")
