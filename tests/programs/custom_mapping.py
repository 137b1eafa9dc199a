import catenary as cat
from catenary import types

with cat.MainDevice("eth0") as main:
    sensor = cat.ProcessData(
        main.scan()[1],
        inputs={"force": (0x6000, 1, types.REAL), "status": (0x6010, 0, types.UDINT)},
        outputs={"tare": (0x7000, 1, types.BOOL)},
        pdos={0x1A00: ["force", "status"]},  # optional: else the planner searches
    )
    print(main.plan(sensor, period=1e-3))  # old and new 0x1A00, before anything is written
    with cat.Loop(sensor, period=1e-3) as loop:
        for cycle in loop:
            sensor["tare"] = cycle.number == 0
            if sensor["force"] > 50.0:
                break
    force = sensor["force"]
