import catenary as cat
from catenary import types

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(
        main.scan().drives,
        counts_per_turn=2**20,
        velocity_limit=2.0,
        start_up=[
            cat.StartUp(0x6065, 0, 20_000),  # type from the dictionary
            cat.StartUp(0x2010, 3, 1.5, type=types.REAL),
            cat.StartUp(0x2100, 0, b"\x01\x00", before_mapping=True, verify=False),
        ],  # one list for every device of `arm`
    )
    plan = main.plan(arm)  # section "start-up", in the order of writing
    print(plan)
    with cat.Loop(arm, period=1e-3) as loop:
        for cycle in loop:
            if cycle.time > 0.01:
                break
    window = arm.subs[0].sdo.read(0x6065, 0, type=types.UDINT)
