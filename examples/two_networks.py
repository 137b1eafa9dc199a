"""Upper and lower body of a humanoid on two virtual networks, in one loop."""

import math

import catenary as cat
from catenary.realtime import VirtualClock

with VirtualClock() as clock:  # on the robot: MainDevice("eth0"), MainDevice("eth1")
    bodies = [cat.Segment([cat.virtual.Servo() for _ in range(n)], clock=clock) for n in (18, 15)]
    with cat.MainDevice(bodies[0]) as first, cat.MainDevice(bodies[1]) as second:
        upper = cat.Drives(first.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        lower = cat.Drives(second.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(upper, lower, period=250e-6) as loop:
            for cycle in loop:
                upper.target.position[:] = 0.1 * math.sin(3 * cycle.time)  # [rad]
                lower.target.position[:] = -0.1 * math.sin(3 * cycle.time)
                if cycle.time > 1.0:
                    break
            for number, network in enumerate(loop.networks):
                print(f"network {number}: {network.timing.counters['lost']} lost")
