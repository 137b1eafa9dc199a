import math

import catenary as cat

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
    with cat.Loop(arm, period=1e-3, log=2000, log_axes=True) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 0.1 * math.sin(cycle.time)
            if cycle.time > 1.0:
                break
    loop.log.to_csv("run.csv")  # for `catenary plot run.csv`
    table = loop.log.to_pandas().loc[0.5:]  # the index is the time [s]
    shoulder = table.filter(like="shoulder")
    print(shoulder.describe())
