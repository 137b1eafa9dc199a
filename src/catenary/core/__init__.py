"""The compiled cyclic core: frames, axes, hand-over, cycle, thread.

It works on bytes, arrays and the tables of a CyclePlan, which it reads by attribute. It imports no
other part of catenary.
"""

from catenary.core._axes import (
    AXIS_DROPPED,
    AXIS_FALLBACK,
    AXIS_FOLLOWED,
    AXIS_LIMITED,
    AXIS_MODE_REFUSED,
    AXIS_REFUSED,
)
from catenary.core._axis_log import AXIS_FIELDS
from catenary.core._cia402 import (
    REQUEST_DISABLED,
    REQUEST_ENABLED,
    REQUEST_QUICK_STOP,
    REQUEST_RESET,
    controlword_towards,
    state_of,
)
from catenary.core._clocks import Clock, PhaseController
from catenary.core._cycle import (
    CYCLE_CLOCKS,
    CYCLE_DROPPED,
    CYCLE_DRY,
    CYCLE_LATE,
    CYCLE_LAW_DONE,
    CYCLE_LAW_FAILED,
    CYCLE_LIMITED,
    CYCLE_NONE,
    CYCLE_OK,
    CYCLE_REFUSED,
    CYCLE_STOPPED,
    CYCLE_UNCOMMITTED,
    CYCLE_WORKING_COUNTER,
    RECORD_FIELDS,
)
from catenary.core._engine import Engine
from catenary.core._iteration import Cycle, Iteration
from catenary.core._law import (
    LAW_ABORTED,
    LAW_FINISHED,
    LAW_NEVER_RETURNED,
    LAW_NOT_FINITE,
    LAW_OVERRUN,
    LAW_RAISED,
    LAW_RUNNING,
    LAW_STOPPED,
    Law,
)
from catenary.core._stream import Stream
from catenary.core._trigger import TRIGGER_SIZE, TriggerBlock

__all__ = [
    "AXIS_DROPPED",
    "AXIS_FALLBACK",
    "AXIS_FIELDS",
    "AXIS_FOLLOWED",
    "AXIS_LIMITED",
    "AXIS_MODE_REFUSED",
    "AXIS_REFUSED",
    "CYCLE_CLOCKS",
    "CYCLE_DROPPED",
    "CYCLE_DRY",
    "CYCLE_LATE",
    "CYCLE_LAW_DONE",
    "CYCLE_LAW_FAILED",
    "CYCLE_LIMITED",
    "CYCLE_NONE",
    "CYCLE_OK",
    "CYCLE_REFUSED",
    "CYCLE_STOPPED",
    "CYCLE_UNCOMMITTED",
    "CYCLE_WORKING_COUNTER",
    "LAW_ABORTED",
    "LAW_FINISHED",
    "LAW_NEVER_RETURNED",
    "LAW_NOT_FINITE",
    "LAW_OVERRUN",
    "LAW_RAISED",
    "LAW_RUNNING",
    "LAW_STOPPED",
    "RECORD_FIELDS",
    "REQUEST_DISABLED",
    "REQUEST_ENABLED",
    "REQUEST_QUICK_STOP",
    "REQUEST_RESET",
    "TRIGGER_SIZE",
    "Clock",
    "Cycle",
    "Engine",
    "Iteration",
    "Law",
    "PhaseController",
    "Stream",
    "TriggerBlock",
    "controlword_towards",
    "state_of",
]
