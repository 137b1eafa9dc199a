"""Axes that move independently, as asyncio tasks: `python asyncio_moves.py eth0`, or `virtual`.

The loop runs in the background; `asyncio.to_thread(loop.wait, move)` waits for a move.
"""

import asyncio
import sys

import catenary as cat


async def visit(loop: cat.Loop, arm: cat.Drives, axis: int, goals: list[float]) -> None:
    """Move one axis from goal to goal [rad]."""
    for goal in goals:
        move = arm.move_to(goal, velocity=1.0, axes=[axis])
        await asyncio.to_thread(loop.wait, move)
        print(f"axis {axis}: {arm.actual.position[axis]:.2f} rad")
        await asyncio.sleep(0.1)


async def report(loop: cat.Loop, arm: cat.Drives) -> None:
    """Print the positions every 0.2 s until the loop ends or the task is cancelled."""
    while loop.error is None:
        print("now", arm.actual.position.round(2))
        await asyncio.sleep(0.2)


async def work(target: str) -> None:
    with cat.MainDevice(target) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(arm, period=1e-3) as loop:  # at the end, raises an error of the loop, if any
            loop.run_in_background()
            reporter = asyncio.create_task(report(loop, arm))
            await asyncio.gather(
                visit(loop, arm, 0, [0.3, -0.3, 0.0]),
                visit(loop, arm, 1, [0.1, 0.0]),
            )
            reporter.cancel()


asyncio.run(work(sys.argv[1] if len(sys.argv) > 1 else "virtual"))
