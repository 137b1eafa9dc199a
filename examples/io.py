"""A running light on the first digital output terminal: `python io.py eth0`, or `virtual`."""

import sys

import catenary as cat

with cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual") as main:
    subs = main.scan()
    lamps = cat.Outputs(subs[1])  # by name or as a row of bits
    print("outputs:", ", ".join(lamps.names))
    with cat.Loop(lamps, period=10e-3) as loop:
        for cycle in loop:
            lamps.bits[:] = 0
            lamps.bits[cycle.number // 10 % len(lamps.bits)] = 1
            if cycle.time > 5.0:
                lamps[lamps.names[0]] = 0  # the same bit by its name
                break
