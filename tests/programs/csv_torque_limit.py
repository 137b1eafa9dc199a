import catenary as cat

with cat.MainDevice("eth0") as main:
    wheel = cat.Drives(
        main.scan().drives,
        mode="csv",
        counts_per_turn=2**20,
        velocity_limit=20.0,  # [rad/s]
        torque_limit=0.5,  # [N·m]
        columns=["max_torque"],  # 0x6072: the drive limits its torque, here to torque_limit
    )
    with cat.Loop(wheel, period=1e-3) as loop:
        for cycle in loop:
            wheel.target.velocity[:] = min(10.0 * cycle.time, 10.0)
            if cycle.time > 2.0:
                break
        velocity, torque = wheel.actual.velocity.copy(), wheel.actual.torque.copy()
