import catenary as cat
from catenary.drive import HomingMethod

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(
        main.scan().drives,
        counts_per_turn=2**20,
        velocity_limit=2.0,
        other_modes=["hm"],
        homing=HomingMethod(37),  # the present position is home
    )
    with cat.Loop(arm, period=1e-3) as loop:
        loop.wait(arm.home(), timeout=30.0)
        loop.wait(arm.move_to(0.1))
