"""Control blocks for laws and for plain Python, and trajectories (docs/control.md).

A block is two things: a value that holds its numbers (`Cascade(...)`, with `.parameters` and
`.memory` as flat rows of float64), and its step, a function of those rows and of an axis
(`cascade(memory, parameters, i, ...)`). State is nowhere but in the memory; zeros begin anew.
"""

from catenary.control.cascade import Cascade, cascade
from catenary.control.dynamics import Dynamics, gravity, inverse
from catenary.control.parts import join, part, restart
from catenary.control.pid import Pid, pid
from catenary.control.trajectory import MotionLimits, MotionState, Trajectory, trajectory

__all__ = [
    "Cascade",
    "Dynamics",
    "MotionLimits",
    "MotionState",
    "Pid",
    "Trajectory",
    "cascade",
    "gravity",
    "inverse",
    "join",
    "part",
    "pid",
    "restart",
    "trajectory",
]
