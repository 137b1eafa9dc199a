"""Tasks for tests, importable by their processes: a policy that is killed, and a reader."""

import os
import signal
from typing import Any

import numpy as np

from catenary import control

RULE = control.ActionRule(1, low=-2.0, high=2.0, hold=0.03, decay=0.1)
PHASES = ("ok", "held", "decaying", "neutral")
KILLED = 20  # number of the job


def ramp(observation: np.ndarray) -> np.ndarray:
    return observation


def think(task: Any, policy: control.Policy, actions: Any) -> None:
    """Run the policy at 100 Hz. The kernel kills the process in the job `KILLED`."""
    for job in task:
        if job.number == KILLED:
            os.kill(os.getpid(), signal.SIGKILL)
        actions.write(policy.step([job.time], job.time))


def act(task: Any, actions: Any, rows: Any) -> None:
    """Put the time, the action and the number of the phase of every job into a queue."""
    reader = control.ActionReader(actions, RULE)
    for job in task:
        action = reader.read(job.time)[0]
        rows.put([job.time, action, PHASES.index(reader.status.phase)])
