import catenary as cat
from catenary import types

with cat.MainDevice("eth0") as main:
    subs = main.scan()
    valves = cat.ProcessData(
        subs[1],
        outputs={"clamp": (0x7000, 1, types.BOOL), "vacuum": (0x7020, 1, types.BOOL)},
        safe={"vacuum": True},  # sent when the loop ends; the others: 0
    )
    buttons = cat.Inputs(subs[2], channels={"start": (0x6000, 1, types.BOOL)})
    with cat.Loop(valves, buttons, period=1e-3) as loop:
        for cycle in loop:
            valves["clamp"] = buttons["start"]
            if cycle.time > 0.1:
                break
