"""State of the axes and of the cycle, as the page shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from catenary.plan.stop_reason import StopReason
from catenary.share import SharedEvent, ShareLayout
from catenary.wire.cia402 import IN_FAULT, AxisState

STATES = {int(state): state.name for state in AxisState}
NUMBERS = ("position", "velocity", "torque", "commanded_position")


class AxisNotes:
    """Texts of the newest faults and stops, from the events of the loop.

    `devices`: position of the device of each axis, by name; empty if unknown.
    """

    def __init__(self) -> None:
        self.devices: Mapping[str, int] = {}
        self._stops: dict[str, str] = {}
        self._faults: dict[int, str] = {}

    def add(self, event: SharedEvent) -> None:
        """Note a stop of an axis or an emergency of a device."""
        if event.kind == "AxisStopped":
            self._stops[str(event.details.get("axis"))] = stop_text(event)
        elif event.kind == "Emergency" and event.position is not None:
            self._faults[event.position] = event.message

    def stop_reason(self, axis: str, enabled: bool) -> str:
        """Return the reason of the last stop; "" since the axis was enabled again.

        Args:
            axis: name of the axis.
            enabled: True if the axis is enabled now.
        """
        if enabled:
            self._stops.pop(axis, None)
        return self._stops.get(axis, "")

    def fault(self, axis: str) -> str:
        """Return a text for an axis in fault."""
        device = self.devices.get(axis)
        return self._faults.get(-1 if device is None else device, "the drive is in fault")


def stop_text(event: SharedEvent) -> str:
    """Return the text of the reason of an AxisStopped event."""
    reason = event.details.get("reason")
    if isinstance(reason, int) and reason in {int(each) for each in StopReason}:
        return StopReason(reason).text
    return event.message


def cycle_status(row: np.void) -> dict[str, object]:
    """Return the values of a cycle that do not belong to an axis."""
    return {
        "time": float(row["scheduled_ns"]) * 1e-9,
        "number": int(row["number"]),
        "lost_in_row": int(row["lost_in_row"]),
        "lateness": float(row["lateness_ns"]) * 1e-9,
    }


def axis_statuses(row: np.void, layout: ShareLayout, notes: AxisNotes) -> list[dict[str, object]]:
    """Return the status of each axis.

    Args:
        row: newest cycle of the share.
        layout: layout of the share.
        notes: texts of faults and stops.
    """
    if not layout.axes:
        return []
    names = row.dtype.names or ()
    jogged = row["jogged"] if "jogged" in names else np.zeros(len(layout.axes), np.uint8)
    numbers = {name: row[name] for name in NUMBERS if name in names}
    return [
        _axis_status(
            name,
            state=int(row["state"][k]),
            enabled=bool(row["enabled"][k]) or bool(jogged[k]),  # a jogged axis follows no targets
            notes=notes,
            jogged=bool(jogged[k]),
            **{key: _finite(numbers[key][k]) if key in numbers else None for key in NUMBERS},
        )
        for k, name in enumerate(layout.axes)
    ]


def _axis_status(
    name: str, *, state: int, enabled: bool, notes: AxisNotes, **values: object
) -> dict[str, object]:
    is_in_fault = state in [int(each) for each in IN_FAULT]
    return {
        "name": name,
        "state": STATES.get(state, ""),
        "enabled": enabled,
        "fault": notes.fault(name) if is_in_fault else "",
        "stop_reason": notes.stop_reason(name, enabled),
        **values,
    }


def _finite(value: np.float64) -> float | None:
    return float(value) if math.isfinite(value) else None
