import catenary as cat
from catenary import types
from catenary.drive import Channel

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(
        main.scan().drives,
        counts_per_turn=2**20,
        velocity_limit=1.0,
        columns={
            "temperature": (0x2020, 0, types.INT, 0.1),  # read, scaled
            "torque_feed_forward": (0x60B2, 0, types.INT),  # CiA 402: written
            "lamp": Channel(0x2021, 0, types.UINT, output=True),
        },
    )
    with cat.Loop(arm, period=1e-3) as loop:
        for cycle in loop:
            arm.target["torque_feed_forward"] = 12
            arm.target["lamp"] = arm.actual["temperature"] > 30.0
            if cycle.time > 0.1:
                break
