"""The difference to look at first: the most likely cause of an error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from catenary.capture.contents import StateRefused
from catenary.capture.difference import DeviceComparison, Difference, Mark, Topic
from catenary.capture.events import Event

_CLOCK = (Topic.CLOCK,)
_LAYOUT = (Topic.SYNC_MANAGER, Topic.MAPPING, Topic.FMMU)
_WATCHDOG = (Topic.WATCHDOG,)
# AL status codes, ETG.1000.6 table 11 and ETG.1020: the settings that a device checks before them
_TOPICS: Mapping[int, tuple[Topic, ...]] = {
    0x0015: (Topic.MAILBOX,),  # invalid mailbox configuration, BOOT
    0x0016: (Topic.MAILBOX,),  # invalid mailbox configuration, PRE-OP
    0x0017: _LAYOUT,  # invalid SyncManager configuration
    0x001A: _CLOCK,  # synchronization error
    0x001B: _WATCHDOG,  # SyncManager watchdog
    0x001C: _LAYOUT,  # invalid SyncManager types
    0x001D: _LAYOUT,  # invalid output configuration
    0x001E: _LAYOUT,  # invalid input configuration
    0x001F: _WATCHDOG,  # invalid watchdog configuration
    0x0024: _LAYOUT,  # invalid input mapping
    0x0025: _LAYOUT,  # invalid output mapping
    0x0027: _CLOCK,  # free run not supported
    0x0028: _CLOCK,  # synchronization not supported
    0x0029: _LAYOUT,  # free run needs 3-buffer mode
    **dict.fromkeys((0x002C, 0x002D, 0x002E), _CLOCK),  # SYNC errors, cycle time too small
    **dict.fromkeys(range(0x0030, 0x0038), _CLOCK),  # DC configuration, PLL, cycle times
}


@dataclass(frozen=True, slots=True)
class FirstDifference:
    """The difference to look at first. `error` is an AL status code in capture `side`."""

    device: DeviceComparison
    row: Difference
    side: str = ""  # "A" or "B": the capture with the error; empty without an error
    error: int | None = None

    @property
    def text(self) -> str:
        """The name of the difference, such as `AssignActivate of device 1`."""
        device = self.device.pair.device
        place = device.number if device.position is None else device.position
        is_device = self.row.topic is Topic.DEVICE and self.row.subject == "device"
        text = f"device {place}" if is_device else f"{self.row.subject} of device {place}"
        is_alone = self.row.mark in (Mark.ONLY_A, Mark.ONLY_B)
        return f"{text}, {self.row.mark.value}" if is_alone else text


def find_first(devices: Sequence[DeviceComparison]) -> FirstDifference | None:
    """Return the difference to look at first; None if there is none.

    It belongs to the device with the first error in B, else in A. If this device has no
    difference, or without an error, it belongs to any device.

    Args:
        devices: All devices.
    """
    for side in ("B", "A"):
        failed = [each for each in devices if _error(each, side) and not _error(each, _other(side))]
        failed.sort(key=lambda each: _time(_error(each, side)))
        for each in failed:
            code = _code(_error(each, side))
            row = _first_row(each.rows, code)
            if row is not None:
                return FirstDifference(each, row, side, code)
    rows = [(row, each) for each in devices for row in each.rows if row.mark is not Mark.RESULT]
    rows.sort(key=lambda found: (not found[0].effect, found[0].topic is not Topic.DEVICE))
    if not rows:
        return None
    error = next((each for each in devices if each.error_b and not each.error_a), None)
    row, device = rows[0]
    if error is None:
        return FirstDifference(device, row)
    return FirstDifference(device, row, "B", _code(error.error_b))


def _error(device: DeviceComparison, side: str) -> Event | None:
    return device.error_a if side == "A" else device.error_b


def _other(side: str) -> str:
    return "A" if side == "B" else "B"


def _time(event: Event | None) -> int:
    return event.time_ns if event else 0


def _code(event: Event | None) -> int | None:
    content = event.content if event else None
    return content.code if isinstance(content, StateRefused) else None


def _first_row(rows: Sequence[Difference], code: int | None) -> Difference | None:
    """Return the row to look at first; None if there is only the result.

    Rows that concern the error come first, then those that change what the device does, then
    the others. Rows of one rank keep their order.

    Args:
        rows: Rows of one device.
        code: AL status code of the error; None without an error.
    """
    related = () if code is None else _TOPICS.get(code, ())
    candidates = [each for each in rows if each.mark is not Mark.RESULT]
    return min(
        candidates,
        key=lambda each: (not each.effect, each.topic not in related),
        default=None,
    )
