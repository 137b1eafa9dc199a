"""Scenarios of the humanoid: what happens to it, and when.

The times of the events count from the end of the bring-up: the robot hangs in its gantry, its
drives are enabled, its feet touch the floor, and the gantry opens.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from catenary.virtual import faults

if TYPE_CHECKING:
    from world import World

FORCE, TILT = 60.0, 4.0  # [N], [degrees]
IMPULSE = 35.0  # [N·s]
UPPER, LOWER, LEFT_FOOT = 0, 1, 16  # numbers of the networks; position of a force sensor

Action = Callable[["World"], None]


@dataclass(frozen=True)
class Happening:
    """Event at a time after the bring-up [s]. Requests of the operator have no text."""

    at: float
    text: str
    act: Action


@dataclass(frozen=True)
class Scenario:
    """A run of the program.

    Args:
        name: name of the run and of its files.
        text: what it shows.
        seconds: duration after the bring-up [s].
        happenings: what happens to the robot.
        mode: mode after the bring-up: "balance", or "stand" for plain PD.
    """

    name: str
    text: str
    seconds: float
    happenings: Sequence[Happening] = ()
    mode: str = "balance"


def push(at: float, force: Sequence[float], seconds: float, body: str = "torso") -> Happening:
    """Push a body with a force [N]."""
    text = f"push {np.linalg.norm(force):.0f} N for {seconds:g} s"
    return Happening(at, text, lambda world: world.push(body, force, seconds))


def tilt(at: float, degrees: float, seconds: float = 0.5, steps: int = 100) -> list[Happening]:
    """Tilt the floor forward, with a constant speed [degrees] in `seconds`."""

    def to(angle: float) -> Action:
        return lambda world: world.tilt_floor(np.radians(angle))

    share = np.arange(1, steps + 1) / steps
    first, *rest = (Happening(at + each * seconds, "", to(each * degrees)) for each in share)
    return [replace(first, text=f"floor tilts by {degrees:g} degrees in {seconds:g} s"), *rest]


def cut(at: float, network: int, between: tuple[int, int]) -> Sequence[Happening]:
    """Cut a cable of a ring, and join it 0.3 s later."""
    where = f"cable {between[0]}-{between[1]} of the {('upper', 'lower')[network]} ring"
    return (
        Happening(
            at, f"{where} cut", lambda world: world.inject(network, faults.cut(between=between))
        ),
        Happening(
            at + 0.3,
            f"{where} joined",
            lambda world: world.inject(network, faults.join(between=between)),
        ),
    )


def power(at: float, device: int, on: bool) -> Happening:
    text = f"power of device {device} of the lower ring {'on' if on else 'off'}"
    return Happening(at, text, lambda world: world.switch_power(LOWER, device, on))


def kill(at: float, task: str) -> Happening:
    """Kill the process of a task (SIGKILL)."""

    def act(world: World) -> None:
        os.kill(world.tasks[task].process, signal.SIGKILL)

    return Happening(at, f"task {task} killed", act)


def preset(at: float, name: str) -> Happening:
    return Happening(at, "", lambda world: world.request("preset", name))


def mode(at: float, name: str) -> Happening:
    return Happening(at, "", lambda world: world.request("mode", name))


FAULTS = (
    *cut(0.5, UPPER, (5, 6)),
    *cut(1.0, LOWER, (8, 9)),
    power(1.6, LEFT_FOOT, False),
    push(1.8, (30.0, 0.0, 0.0), 0.5),
    power(2.4, LEFT_FOOT, True),
)

WAVES = (preset(0.3, "wave"), preset(5.5, "reach"))

ALL = (
    Scenario("stand", "quiet standing", 2.0),
    Scenario("wave", "an arm waves, and both reach forward", 8.0, WAVES),
    Scenario("push", "a sustained push of 60 N", 3.5, [push(0.3, (FORCE, 0, 0), 3.0)]),
    Scenario("tilt", "the floor tilts by 4 degrees", 3.5, tilt(0.3, TILT)),
    Scenario("impulse", "an impulse from behind", 3.5, [push(0.3, (IMPULSE / 0.1, 0, 0), 0.1)]),
    Scenario("faults", "a cut cable on each ring, and a lost force sensor", 3.5, FAULTS),
    Scenario("kill-log", "the log task is killed", 1.0, [kill(0.5, "log")]),
    Scenario("kill-balance", "the balance task is killed", 2.5, [kill(0.3, "balancing")]),
)
BY_NAME: Mapping[str, Scenario] = {
    each.name: each
    for scenario in ALL
    for each in (
        scenario,
        replace(
            scenario, name=f"{scenario.name}-pd", text=f"{scenario.text}; plain PD", mode="stand"
        ),
    )
}
MAIN = ("stand", "push", "push-pd", "tilt", "tilt-pd", "impulse", "faults", "kill-balance")
