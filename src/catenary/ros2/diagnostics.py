"""Diagnostic statuses: loop, axes, devices, cables, sensors and the bridge itself."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from catenary.core import AXIS_DROPPED, AXIS_FALLBACK, AXIS_LIMITED, AXIS_REFUSED, CYCLE_OK
from catenary.remote.messages import Device
from catenary.ros2.messages import DiagnosticStatus, KeyValue
from catenary.share import Reader
from catenary.wire.cia402 import state_of

Rows = npt.NDArray[np.void]
OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
REMARKS = {
    AXIS_DROPPED: "stopped",
    AXIS_REFUSED: "refused",
    AXIS_LIMITED: "limited",
    AXIS_FALLBACK: "fallback",
}
REPORTS = 10  # newest reports in the status of the bridge


def status(level: int, name: str, message: str, values: Mapping[str, object]) -> DiagnosticStatus:
    """Return a diagnostic status.

    Args:
        level: OK, WARN, ERROR or STALE.
        name: component.
        message: summary.
        values: further values by name.
    """
    pairs = tuple(KeyValue(key, str(value)) for key, value in values.items())
    return DiagnosticStatus(level, plain(name), plain(message), "", pairs)


def plain(text: str) -> str:
    """Return a text with control characters replaced by '?'."""
    return "".join(each if each.isprintable() else "?" for each in text)


class Reports:
    """Owner of the counters and the newest texts of what the bridge has refused or lost."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.notes: list[str] = []  # permanent restrictions, which are not incidents
        self.texts: deque[str] = deque(maxlen=REPORTS)
        self._unread: deque[str] = deque(maxlen=REPORTS)

    def add(self, kind: str, text: str) -> None:
        """Count an incident, and keep its text.

        Args:
            kind: name of the counter, such as "refused commands".
            text: description of the incident.
        """
        self.counts[kind] += 1
        self.texts.append(text)
        self._unread.append(text)

    def unread(self) -> list[str]:
        """Return the texts since the last call; at most the newest 10."""
        found = list(self._unread)
        self._unread.clear()
        return found


def bridge_status(name: str, reports: Reports, incompatible: Sequence[str]) -> DiagnosticStatus:
    """Return the status of the bridge.

    Args:
        name: name of the share.
        reports: incidents since the start of the bridge.
        incompatible: QoS mismatches.
    """
    texts = [*incompatible, *reports.texts]
    values: dict[str, object] = {**reports.counts, "QoS mismatches": len(incompatible)}
    values |= {f"note {number}": text for number, text in enumerate(reports.notes, 1)}
    values |= {f"report {number}": text for number, text in enumerate(texts, 1)}
    level = WARN if texts else OK
    return status(level, f"{name}: bridge", texts[-1] if texts else "no incidents", values)


class LoopTiming:
    """Owner of the number of the last cycle in the status of a loop."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._number = max(reader.number - 1, 0)  # the first status has the newest cycle

    def status(self) -> DiagnosticStatus:
        """Return the status of the loop in the cycles since the last call."""
        rows, overwritten = self._reader.rows(self._number)
        name = f"{self._reader.layout.name}: loop"
        if not len(rows):
            return status(STALE, name, "no new cycle", {})
        self._number = int(rows["number"][-1])
        if "flags" not in (rows.dtype.names or ()):
            return status(OK, name, f"{len(rows)} samples", {})
        return loop_status(name, rows, overwritten)


def loop_status(name: str, rows: Rows, overwritten: int) -> DiagnosticStatus:
    """Return the status of a loop.

    Args:
        name: name of the component.
        rows: cycles, at least one.
        overwritten: number of further cycles that could not be read.
    """
    cycles = len(rows) + overwritten
    lost = int((rows["flags"] & CYCLE_OK == 0).sum())
    skipped = int(rows["skipped"].sum())
    in_row = int(rows["lost_in_row"][-1])
    level = ERROR if in_row else WARN if lost or skipped else OK
    known = rows["round_trip_ns"][rows["round_trip_ns"] >= 0]
    values = {
        "cycle": int(rows["number"][-1]),
        "lateness, largest [s]": f"{float(rows['lateness_ns'].max()) * 1e-9:.6g}",
        "round trip, median [s]": f"{float(np.median(known)) * 1e-9:.6g}" if len(known) else "",
        "lost in a row": in_row,
    }
    return status(level, name, f"{lost} of {cycles} cycles lost, {skipped} skipped", values)


def axis_statuses(reader: Reader, row: np.void) -> list[DiagnosticStatus]:
    """Return the status of each axis.

    Args:
        reader: reader of the share.
        row: a cycle.
    """
    layout = reader.layout
    return [_axis(layout.name, axis, row, k) for k, axis in enumerate(layout.axes)]


def _axis(share: str, axis: str, row: np.void, number: int) -> DiagnosticStatus:
    state = state_of(int(row["statusword"][number]))
    flags = int(row["axis_flags"][number])
    text = "unknown" if state is None else state.name.lower().replace("_", " ")
    remarks = [remark for bit, remark in REMARKS.items() if flags & bit]
    fault = state is not None and state.name.startswith("FAULT")
    level = ERROR if fault else WARN if remarks else OK
    values = {
        "position": f"{float(row['position'][number]):.6g}",
        "mode": int(row["mode"][number]),
        "enabled": bool(row["enabled"][number]),
    }
    return status(level, f"{share}: {axis}", ", ".join((text, *remarks)), values)


def device_statuses(share: str, devices: Iterable[Device]) -> list[DiagnosticStatus]:
    """Return the status of each device, and of the cables at its ports.

    Args:
        share: name of the share.
        devices: devices of the segment.
    """
    found = list(devices)
    return [_device(share, each) for each in found] + [
        _cables(share, each) for each in found if each.ports
    ]


def _device(share: str, device: Device) -> DiagnosticStatus:
    level = ERROR if device.error or device.lost else OK if device.state == "OP" else WARN
    text = device.al_status_text if device.error else device.state
    values = {
        "name": device.name,
        "order": device.order,
        "AL status code": f"0x{device.al_status_code:04X}",
        "serial number": device.serial,
    }
    name = f"{share}: device {device.position}"
    return status(level, name, "lost" if device.lost else text or "no answer", values)


def _cables(share: str, device: Device) -> DiagnosticStatus:
    values: dict[str, object] = {}
    errors = 0
    for port in device.ports:
        errors += port.rx_errors + port.lost_links
        values[f"port {port.port}"] = (
            f"{'link' if port.link else 'no link'}, {port.rx_errors} receive errors, "
            f"{port.forwarded_errors} forwarded, {port.lost_links} lost links"
        )
    text = f"{errors} receive errors and lost links" if errors else "no errors"
    return status(
        WARN if errors else OK, f"{share}: cables of device {device.position}", text, values
    )


def missing_status(share: str, reason: str) -> DiagnosticStatus:
    """Return the status of a share without new cycles.

    Args:
        share: name of the share.
        reason: why there are none.
    """
    return status(STALE, f"{share}: loop", reason, {})


def sensor_status(share: str, reason: str) -> DiagnosticStatus:
    """Return the status of a sensor's share.

    Args:
        share: name of the share.
        reason: why its newest sample is not published; "" if it is.
    """
    return status(ERROR if reason else OK, f"{share}: sensor", reason or "valid", {})


def devices_unknown(share: str, reason: str) -> DiagnosticStatus:
    """Return the status of devices that the program does not report.

    Args:
        share: name of the share.
        reason: why it does not.
    """
    return status(STALE, f"{share}: devices", reason, {})
