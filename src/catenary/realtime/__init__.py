"""Real-time tasks with fixed priorities, their analysis, and machine and virtual clocks.

Submodules contain scheduling, private networks and child processes.

    def control(task, gain):
        for job in task:            # every 2 ms, until the task is stopped
            ...

    with realtime.Tasks(realtime.Task(control, (0.5,), period=2e-3, priority=90)) as tasks:
        tasks.join(60.0)
    print(tasks)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.realtime.analysis import Demand, Verdict, analyse
    from catenary.realtime.analysis_file import read_demands
    from catenary.realtime.clock import Participant, VirtualClock
    from catenary.realtime.exchange import Queue, Silence, Value
    from catenary.realtime.job import Job
    from catenary.realtime.running_task import Running
    from catenary.realtime.statistics import Statistics
    from catenary.realtime.system.preparation import Session, session
    from catenary.realtime.task import Task
    from catenary.realtime.tasks import Tasks
    from catenary.realtime.trigger import Signal

__all__ = [
    "Demand",
    "Job",
    "Participant",
    "Queue",
    "Running",
    "Session",
    "Signal",
    "Silence",
    "Statistics",
    "Task",
    "Tasks",
    "Value",
    "Verdict",
    "VirtualClock",
    "analyse",
    "read_demands",
    "session",
]

_MODULES = {
    "Demand": "analysis",
    "Job": "job",
    "Participant": "clock",
    "Queue": "exchange",
    "Running": "running_task",
    "Session": "system.preparation",
    "Signal": "trigger",
    "Silence": "exchange",
    "Statistics": "statistics",
    "Task": "task",
    "Tasks": "tasks",
    "Value": "exchange",
    "Verdict": "analysis",
    "VirtualClock": "clock",
    "analyse": "analysis",
    "read_demands": "analysis_file",
    "session": "system.preparation",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
