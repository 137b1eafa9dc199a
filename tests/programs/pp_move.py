import catenary as cat

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(main.scan().drives, mode="pp", counts_per_turn=2**20, velocity_limit=2.0)
    with cat.Loop(arm, period=1e-3) as loop:
        move = arm.move_to([0.5, -0.2, 1.0], velocity=0.5, acceleration=2.0)
        loop.wait(move, timeout=10.0)  # iterates; DriveError, MoveError(axis, remaining)
        move = arm.move_by(0.1, axes=[2])
        for cycle in loop:  # or go on with something else
            if move.done:
                break
            if cycle.time > 3.0:
                move.stop()  # decelerates and holds
