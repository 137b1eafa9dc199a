import catenary as cat

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
    stops = cat.StopPolicy(raise_faults=False)
    with cat.Loop(arm, period=1e-3, stop=stops) as loop:
        while True:
            try:
                loop.wait(arm.move_to(1.0), timeout=10.0)
                break
            except cat.MoveError as error:
                print(error)
                arm.enable()  # resets the fault, if its cause is gone
                for _ in loop:
                    if arm.enabled.all():
                        break
