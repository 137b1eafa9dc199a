import asyncio

import catenary as cat


async def sort(loop: cat.Loop, arm: cat.Drives, axis: int, goals: list[float]) -> None:
    for goal in goals:
        move = arm.move_to(goal, velocity=1.0, axes=[axis])
        await asyncio.to_thread(loop.wait, move)
        print(f"axis {axis} is at {arm.actual.position[axis]:.2f} rad")


async def work() -> None:
    with cat.MainDevice("eth0") as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.run_in_background()
            await asyncio.gather(sort(loop, arm, 0, [0.2, -0.1]), sort(loop, arm, 1, [0.1, 0.0]))


asyncio.run(work())
