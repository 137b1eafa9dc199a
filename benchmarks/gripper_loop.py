"""Loop of a gripper with two drives at 2 kHz: `python -m benchmarks.gripper_loop SETTING`.

The process data and the pre-filter of the references are those of RDDA. The loop runs a law. It
publishes a share, from which a client takes the states and to which it sends references
(`benchmarks.gripper_client`). The process prints "ready" when the law runs, and then its results.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

import catenary as cat
from benchmarks.tables.published import RDDA_COLUMNS
from catenary import control
from catenary.bench.python_loop import LATE_LIMIT, LOST_LIMIT
from catenary.bench.rounds import WARM_UP_CYCLES
from catenary.errors import CatenaryError

AXES = 2
FILTER_RATIO = (
    1 / 8
)  # corner of the second-order Butterworth filter / rate: published 250 Hz at 2 kHz
INERTIA = 2.7e-4  # [kg·m²] of a finger with its motor, as in examples/gripper
POLL = 2e-3  # [s] between two readings of the client's commands
CYCLE_OK = 1  # bit in the flags of a record


class Setting(msgspec.Struct):
    """Parameters of a run."""

    interface: str
    share: str
    rate: int
    cycles: int
    cpu: int | None
    priority: int


class Found(msgspec.Struct):
    """Results of a run: [ns] per cycle, and counts."""

    lateness_ns: list[int]
    period_ns: list[int]
    output_delay_ns: list[int]
    lost: int
    commands: int  # commands of the client that reached the law
    scheduling: str


@cat.law
def follow(actual: Any, target: Any, memory: Any, parameters: Any) -> None:
    """Filter the references; send their derivatives as feed-forward velocity and torque."""
    smooth, last, speed = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    goals = control.part(parameters, 1)
    for i in range(actual.n):
        wanted = control.low_pass(smooth, control.part(parameters, 0), i, goals[i])
        velocity = (wanted - last[i]) / actual.dt
        target.position[i] = wanted
        target["velocity_offset"][i] = velocity
        target["torque_offset"][i] = INERTIA * (velocity - speed[i]) / actual.dt
        last[i], speed[i] = wanted, velocity


def run(setting: Setting) -> Found:
    with cat.MainDevice(setting.interface) as main:
        arm = cat.Drives(
            main.scan().drives,
            mode="csp",
            counts_per_turn=2**20,
            velocity_limit=50.0,
            columns=RDDA_COLUMNS,
        )
        share = cat.Share(setting.share)
        with (
            share,
            cat.Loop(
                arm,
                period=1 / setting.rate,
                cpu=setting.cpu,
                priority=setting.priority,
                stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
                log=WARM_UP_CYCLES + 2 * setting.cycles,
                laws=[follow],
                sink=share,
            ) as loop,
        ):
            return count(loop, arm, share, setting)


def count(loop: cat.Loop, arm: cat.Drives, share: cat.Share, setting: Setting) -> Found:
    """Run the law and pass it the references of the client, until all cycles are counted."""
    home = arm.actual.position.copy()
    goals = home.copy()
    smooth = control.LowPass(AXES, FILTER_RATIO * setting.rate, 1 / setting.rate)
    memory = control.join(smooth.memory, home, np.zeros(AXES))
    running = loop.start(follow, memory, control.join(smooth.parameters, goals), budget=0)
    print("ready", flush=True)
    commands, last = 0, WARM_UP_CYCLES + setting.cycles
    while running.steps < last:
        before = running.steps
        time.sleep(POLL)
        for command in share.commands():
            if command.position is not None:
                goals[list(command.axes)] = command.position
                commands += 1
        running.parameters = control.join(smooth.parameters, goals)
        if running.steps == before:
            next(loop)  # raises the error that stopped the law
    return found(loop, setting, commands)


def found(loop: cat.Loop, setting: Setting, commands: int) -> Found:
    log = loop.log
    log = log[log["process_ns"] >= 0]  # omit the cycle in progress
    log = log[-setting.cycles :]
    if len(log) < setting.cycles:
        raise CatenaryError(f"the log holds only {len(log)} of {setting.cycles} cycles")
    lateness, period, delay = (
        log[f"{name}_ns"].tolist() for name in ("lateness", "period", "output_delay")
    )
    lost = int(np.count_nonzero(log["flags"] & CYCLE_OK == 0))
    return Found(lateness, period, delay, lost, commands, loop.scheduling)


def main(arguments: Sequence[str]) -> None:
    setting = msgspec.json.decode(arguments[0], type=Setting)
    print(msgspec.json.encode(run(setting)).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
