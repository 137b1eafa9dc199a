import catenary as cat

with cat.MainDevice("eth0") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
    with cat.Loop(arm, period=1e-3) as loop:
        for cycle in loop:
            if cycle.number == 100:
                cycle.spend(0.02)  # stands for slow work in the loop
            if cycle.time > 0.5:
                break
    worst = loop.timing["lateness"]["max"]  # [s]
    if loop.timing.counters["uncommitted"]:
        print(f"latest wake-up after {worst * 1e6:.0f} us")
        print(loop.timing.verdict)
