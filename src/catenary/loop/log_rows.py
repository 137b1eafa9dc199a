"""Conversion of the core's records to a Log with names and the time of `cycle.time`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from catenary.core import AXIS_FIELDS, RECORD_FIELDS, Engine
from catenary.log import TIME, Log
from catenary.plan.cycle import AxisPlan, CyclePlan

RESERVED = "reserved"
TIME_FORMAT = "<f8"


def read_log(engine: Engine, plan: CyclePlan) -> Log:
    """Return the last cycles, oldest first.

    `time` counts from the first iteration; before it, from the first cycle.

    Args:
        engine: Engine with the records.
        plan: Plan of the cycle.
    """
    dtype = log_dtype(axis_names(plan.axes) if plan.log_axes else ())
    record_size = dtype.itemsize - np.dtype(TIME_FORMAT).itemsize
    records = np.frombuffer(engine.log(), np.uint8).reshape(-1, record_size)
    rows = np.empty((len(records), dtype.itemsize), np.uint8)
    rows[:, -record_size:] = records
    log = rows.view(dtype)[:, 0]
    log[TIME] = (log["scheduled_ns"] - (engine.zero_ns or engine.origin)) * 1e-9
    return Log(log)


def log_dtype(axes: Sequence[str]) -> np.dtype[np.void]:
    """Return the fields of a cycle: time, record, and those of each axis."""
    fields = [(TIME, TIME_FORMAT), *RECORD_FIELDS]
    fields += [
        (name if name == RESERVED else f"{axis}.{name}", kind)
        for axis in axes
        for name, kind in AXIS_FIELDS
    ]
    sizes = [np.dtype(kind).itemsize for _, kind in fields]
    offsets = list(accumulate(sizes, initial=0))
    shown = [place for place, (name, _) in enumerate(fields) if name != RESERVED]
    return np.dtype(
        {
            "names": [fields[place][0] for place in shown],
            "formats": [fields[place][1] for place in shown],
            "offsets": [offsets[place] for place in shown],
            "itemsize": offsets[-1],
        }
    )


def axis_names(axes: Sequence[AxisPlan]) -> list[str]:
    """Return the name of each axis. An ambiguous name begins with the position of the device."""
    short = [axis.name.removeprefix(f"{axis.device} ") for axis in axes]
    often = Counter(short)
    return [axis.name if often[name] > 1 else name for axis, name in zip(axes, short, strict=True)]
