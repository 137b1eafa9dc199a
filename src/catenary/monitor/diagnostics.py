"""Summary of a share as ROS 2 diagnostics: diagnostic_msgs/DiagnosticArray in CDR."""

from __future__ import annotations

import numpy as np

from catenary.monitor.snapshot import AxisSummary, BusSummary, Summary
from catenary.record.cdr import CdrLayout
from catenary.record.definitions import HEADER, RULE, Definition

OK, WARN, ERROR = 0, 1, 2  # levels of diagnostic_msgs/DiagnosticStatus
DIAGNOSTIC_ARRAY = Definition(
    "diagnostic_msgs/msg/DiagnosticArray",
    f"""\
std_msgs/Header header
DiagnosticStatus[] status
{RULE}
MSG: diagnostic_msgs/DiagnosticStatus
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
KeyValue[] values
{RULE}
MSG: diagnostic_msgs/KeyValue
string key
string value
{RULE}
{HEADER}""",
)
Status = tuple[int, str, str, dict[str, str]]  # level, name, message, values


def encode_diagnostics(name: str, summary: Summary, time_ns: int) -> bytes:
    """Encode a summary as a DiagnosticArray.

    Args:
        name: name of the share.
        summary: loop, bus and axes.
        time_ns: UTC time of the summary [ns].
    """
    message = CdrLayout()
    message.field("sec", "<i4")
    message.field("nanosec", "<u4")
    message.text(name)
    statuses = [bus_status(name, summary.bus), *(axis_status(name, a) for a in summary.axes)]
    message.field("count", "<u4")
    for number, status in enumerate(statuses):
        _add(message, number, status)
    sec, nanosec = divmod(time_ns, 1_000_000_000)
    values = {"sec": sec, "nanosec": nanosec, "count": len(statuses)}
    values |= {f"level{n}": status[0] for n, status in enumerate(statuses)}
    values |= {f"pairs{n}": len(status[3]) for n, status in enumerate(statuses)}
    return message.make().encode({key: np.array([each]) for key, each in values.items()}, 1)


def bus_status(name: str, bus: BusSummary) -> Status:
    """Return the status of the bus.

    Args:
        name: name of the share.
        bus: cycles since the last summary.
    """
    level = ERROR if bus.lost_in_row else WARN if bus.lost or bus.skipped else OK
    text = f"{bus.lost} of {bus.cycles} cycles lost, {bus.skipped} skipped"
    values = {
        "lateness [s]": f"{bus.lateness:.6g}",
        "in controller [s]": f"{bus.in_controller:.6g}",
        "round trip [s]": f"{bus.round_trip:.6g}",
    }
    return level, f"{name}: bus", text, values


def axis_status(name: str, axis: AxisSummary) -> Status:
    """Return the status of an axis.

    Args:
        name: name of the share.
        axis: newest values of the axis.
    """
    level = ERROR if axis.fault else WARN if axis.remarks else OK
    text = f"{axis.state}; {axis.remarks}" if axis.remarks else axis.state
    return level, f"{name}: {axis.name}", text, {"mode": axis.mode}


def _add(message: CdrLayout, number: int, status: Status) -> None:
    _, name, text, values = status
    message.field(f"level{number}", "u1")
    message.text(name)
    message.text(text)
    message.text("")  # hardware_id
    message.field(f"pairs{number}", "<u4")
    for key, value in values.items():
        message.text(key)
        message.text(value)
