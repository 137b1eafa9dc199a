"""The simulated world of a run: what happens to the robot, and what a camera would see of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from exchange import Exchange
from robot import Robot
from scenarios import Scenario

import catenary as cat
from benchmarks.processor import processor_time
from catenary import realtime, virtual
from catenary.virtual.faults import Fault

HANG, LAND, CHANGE = 0.35, 0.2, 0.25  # [s] standing in the gantry; on the floor; to the first event
EVERY = 20  # cycles between two samples


@dataclass
class World:
    """Devices, body and operator of a run."""

    segments: Sequence[cat.Segment]
    plant: virtual.Plant
    robot: Robot
    tasks: realtime.Tasks

    def push(self, body: str, force: Sequence[float], seconds: float) -> None:
        self.segments[0].push(body, force, for_=seconds)

    def tilt_floor(self, angle: float) -> None:
        """Turn the floor forward about the y axis, to `angle` [rad]."""
        model = self.plant.model
        floor = model.geom("floor").id
        model.geom_sameframe[floor] = 0  # MuJoCo uses geom_quat only then
        model.geom_quat[floor] = np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0

    def inject(self, network: int, fault: Fault) -> None:
        self.segments[network].inject(fault)

    def switch_power(self, network: int, device: int, on: bool) -> None:
        self.segments[network].switch_power(device, on)

    def request(self, kind: str, name: str) -> None:
        """Request a mode or preset, as an operator does."""
        self.robot.operation.request(kind, name)

    def release(self) -> None:
        """Open the gantry."""
        self.plant.release()
        self.robot.operation.held = False
        self.robot.operation.note("gantry opened")


class Script:
    """Owner of the events of a scenario that have not happened yet, and of its bring-up."""

    def __init__(self, scenario: Scenario) -> None:
        self._pending = sorted(scenario.happenings, key=lambda each: each.at)
        self._scenario = scenario
        self._steps = [
            (0.0, lambda world: world.request("mode", "stand")),
            (HANG, World.release),
            (HANG + LAND, lambda world: world.request("mode", scenario.mode)),
        ]
        self._ready: float | None = None  # [s] when all drives were enabled
        self.began: float | None = None  # [s] end of the bring-up

    def step(self, now: float, world: World) -> bool:
        """Do what is due. Return False after the end of the scenario."""
        if self._ready is None:
            self._ready = now if world.robot.operation.ready else None
            return True
        while self._steps and now >= self._ready + self._steps[0][0]:
            self._steps.pop(0)[1](world)
        self.began = began = self._ready + HANG + LAND + CHANGE
        while self._pending and now >= began + self._pending[0].at:
            happening = self._pending.pop(0)
            if happening.text:
                world.robot.operation.note(happening.text)
            happening.act(world)
        return now < began + self._scenario.seconds


SAMPLE = np.dtype(
    [
        ("time", "f8"),
        ("base", "f8", 7),  # of the simulation: position [m] and quaternion
        ("com", "f8", 3),  # of the simulation [m]
        ("estimate", "f8", 3),  # estimated centre of mass, from the middle of the feet [m]
        ("tilt", "f8"),  # of the simulation [rad]
        ("position", "f8", 33),
        ("torque", "f8", 33),
        ("force", "f8", 2),  # vertical, of the sensors [N]
    ]
)


class History:
    """Owner of the samples of a run, every 5 ms."""

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []

    def take(self, number: int, world: World, exchange: Exchange) -> None:
        """Keep a sample in every 20th cycle."""
        if number % EVERY:
            return
        state, data = world.robot.state, world.plant.data
        row = np.zeros((), SAMPLE)
        row["time"], row["base"] = state["time"], data.qpos[:7]
        row["com"] = data.subtree_com[world.plant.model.body("pelvis").id]
        row["estimate"] = exchange.estimate.read()["com"]
        _, x, y, _ = data.qpos[3:7]
        row["tilt"] = np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1))
        row["position"], row["torque"] = state["position"], state["torque"]
        row["force"] = -state["feet"][:, 2]
        self._rows.append(row)

    @property
    def rows(self) -> np.ndarray:
        return np.array(self._rows, SAMPLE)


class Meter:
    """Owner of the processor times of the tasks' processes at the start of a run."""

    def __init__(self, tasks: realtime.Tasks) -> None:
        self._tasks = tasks
        self._began = self._now()

    def read(self) -> dict[str, float]:
        """Return the processor time per job of each task that still runs [s]."""
        found = {}
        for name, (seconds, jobs) in self._now().items():
            before, jobs_before = self._began.get(name, (0.0, 0))
            if jobs > jobs_before:
                found[name] = (seconds - before) / (jobs - jobs_before)
        return found

    def _now(self) -> dict[str, tuple[float, int]]:
        return {
            each.name: (processor_time(each.process), each.statistics.jobs)
            for each in self._tasks
            if each.running
        }
