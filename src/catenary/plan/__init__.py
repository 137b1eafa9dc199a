"""Computation of a cycle's tables from device descriptions and process-data requests. No I/O.

Each name is imported at its first use, because a scan needs parts of the plan, but not NumPy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.plan.cycle import CyclePlan, Number, NumberKind
    from catenary.plan.options import PlanOptions
    from catenary.plan.planner import Plan, make_plan
    from catenary.plan.request import (
        DeviceRequest,
        ImageLayout,
        ObjectReference,
        ProcessDataRequest,
        RequestTables,
        Views,
    )

__all__ = [
    "CyclePlan",
    "DeviceRequest",
    "ImageLayout",
    "Number",
    "NumberKind",
    "ObjectReference",
    "Plan",
    "PlanOptions",
    "ProcessDataRequest",
    "RequestTables",
    "Views",
    "make_plan",
]

_HOMES = {
    **dict.fromkeys(("CyclePlan", "Number", "NumberKind"), "catenary.plan.cycle"),
    "PlanOptions": "catenary.plan.options",
    **dict.fromkeys(("Plan", "make_plan"), "catenary.plan.planner"),
    **dict.fromkeys(
        (
            "ImageLayout",
            "ObjectReference",
            "DeviceRequest",
            "Views",
            "ProcessDataRequest",
            "RequestTables",
        ),
        "catenary.plan.request",
    ),
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
