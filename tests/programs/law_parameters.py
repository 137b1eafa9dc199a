from typing import Any

import catenary as cat


@cat.law
def approach(target: Any, memory: Any, dt: Any, parameters: Any) -> None:
    memory[0] += (parameters[0] - memory[0]) * dt / parameters[1]
    for i in range(len(target.position)):
        target.position[i] = memory[0]


with cat.MainDevice("eth0") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
    with cat.Loop(arm, period=1e-3, laws=[approach]) as loop:
        run = loop.start(approach, memory=[0.0], parameters=[0.2, 0.1])  # goal [rad], time [s]
        for cycle in loop:  # the law sets the targets, in the cycle thread
            if cycle.number == 1000:
                reached = arm.actual.position.copy()
                run.parameters = [-0.1, 0.2]  # both at once, before its next step
            if cycle.time > 3.0:
                break
