"""A queue of commands that take effect together, in one cycle: add, execute, read, clear."""

import sys
from collections.abc import Callable
from functools import partial

import numpy as np

import catenary as cat


class CommandQueue:
    """Owns pending commands, and their results by name until `clear`."""

    def __init__(self) -> None:
        self._waiting: list[tuple[str, Callable[[], object]]] = []
        self._results: dict[str, object] = {}

    def add(self, name: str, command: Callable[[], object]) -> None:
        self._waiting.append((name, command))

    def execute(self) -> None:
        """Run all commands between two `next(loop)`; the next one commits them together."""
        waiting, self._waiting = self._waiting, []
        self._results |= {name: command() for name, command in waiting}

    def read(self, name: str) -> object:
        return self._results[name]

    def clear(self) -> None:
        self._waiting, self._results = [], {}


if __name__ == "__main__":
    with cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual") as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        queue = CommandQueue()
        with cat.Loop(arm) as loop:
            goal = arm.actual.position.copy()
            for cycle in loop:
                if cycle.number == 100:
                    queue.add("home", goal.copy)
                    for axis in range(len(arm)):
                        queue.add(
                            f"axis {axis}", partial(goal.__setitem__, axis, goal[axis] + 1e-3)
                        )
                    queue.execute()  # all axes start in the same cycle
                arm.target.position[:] = goal
                if cycle.number == 200:
                    break
            print("moved by", (arm.actual.position - np.asarray(queue.read("home"))).round(4))
