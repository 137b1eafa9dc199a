"""Options and results of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import arms
import body
import numpy as np
from exchange import MODES, Cause, Verdict
from operation import Event
from scenarios import Scenario

if TYPE_CHECKING:
    from catenary import realtime


@dataclass(frozen=True)
class Setup:
    """Options of a run.

    Args:
        scenario: what happens.
        folder: folder of the recordings.
        model: MJCF file of the body.
        name: prefix of the shares.
        virtual: True for virtual time, False for the clock of the machine.
        period: period of the loop [s].
        silence: age of a command or estimate at which the joints brake [s].
        ros2: True to let the hands follow poses of ROS 2.
        policy: ONNX file or function that balances instead of `balance.py`.
    """

    scenario: Scenario
    folder: Path
    model: Path = body.MODEL
    name: str = "humanoid"
    virtual: bool = True
    period: float = 250e-6
    silence: float = 0.010
    ros2: bool = False
    policy: Path | Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def shares(self) -> dict[str, dict[str, tuple[str, ...]]]:
        """Options of the shares by name. The operator uses the share of the upper network."""
        offer = {"modes": MODES, "presets": arms.NAMES}
        return {f"{self.name}-upper": offer, f"{self.name}-lower": {}}

    @property
    def base(self) -> str:
        """Name of the share with the estimated pose of the pelvis."""
        return f"{self.name}-base"


@dataclass(frozen=True)
class Outcome:
    """Results of a run.

    Args:
        setup: options of the run.
        events: what happened, with times of the loop.
        history: `world.SAMPLE` every 20th cycle.
        began: end of the bring-up [s].
        timing: timing of each network.
        seconds: duration in real time [s].
        verdict: last decision of the safety task.
        cause: its cause.
        computing: processor time per job of each task [s].
        tasks: the tasks, with their statistics.
    """

    setup: Setup
    events: Sequence[Event]
    history: np.ndarray
    began: float
    timing: Sequence[Mapping[str, Mapping[str, float]]]
    seconds: float
    verdict: Verdict
    cause: Cause
    computing: Mapping[str, float]
    tasks: realtime.Tasks
