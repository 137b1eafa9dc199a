"""A torque law compiled into the real-time thread: `python compiled_law.py eth0`, or `virtual`.

Needs Numba: pip install 'catenary[law]'. The gains can be changed while it runs.
"""

import sys
from typing import Any

import catenary as cat


# Plain Python here, compiled on the robot. An operator may set its parameters within the limits.
@cat.law(parameters=[cat.Parameter("stiffness", 0, 40), cat.Parameter("damping", 0, 2)])
def pd(actual: Any, target: Any, memory: Any, time: float, parameters: Any) -> bool:
    for i in range(actual.n):
        error = memory[i] - actual.position[i]
        target.torque[i] = parameters[0] * error - parameters[1] * actual.velocity[i]
    return time > 5.0


with cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual") as main:
    arm = cat.Drives(main.scan().drives, mode="cst", counts_per_turn=2**20, velocity_limit=100.0)
    with cat.Loop(arm, period=1e-3, laws=[pd]) as loop:  # compiled before the devices go to OP
        goal = arm.actual.position + 0.5  # [rad]
        run = loop.start(pd, memory=goal, parameters=[4.0, 0.2])  # N·m/rad, N·m/(rad/s)
        for cycle in loop:  # only to observe; the law runs in the cycle thread
            if cycle.number == 1000:
                run.parameters = [8.0, 0.4]  # both in the same cycle
            if not run.running:
                break
        print(f"{run.steps} steps, longest {run.longest * 1e6:.1f} us")
        print("error [rad]:", goal - arm.actual.position)
    print(loop.timing)
