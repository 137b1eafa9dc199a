import catenary as cat

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
    with cat.Loop(arm, period=1e-3) as loop:
        loop.wait(arm.move_to([0.5, -0.2, 1.0], velocity=1.0, acceleration=4.0))
        loop.wait(arm.move_by(0.1, axes=[2], acceleration=4.0, jerk=50.0))  # catenary[traj]
        there = arm.actual.position.copy()
        move = arm.move_to(0.0, velocity=0.2)
        for _ in loop:
            if arm.actual.position[0] < 0.4:
                move.stop()  # decelerates and holds
            if move.done:
                break
        print(move.outcome, move.remaining)
