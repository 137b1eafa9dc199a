"""What can happen on a segment beside the cycle, as frozen values.

`time` [s] is on the clock of `cycle.time` while a loop is open: it counts from the first iteration,
and is negative for events of the start-up. Without a loop, or before the first iteration, it is the
link's clock (`time.monotonic()` on a NIC). `sub` is the device that the event is about, None if it
is about the segment. `message` has all of it in words. The rest is for programs:

    for event in main.events:
        match event:
            case events.Emergency(sub=sub, error_code=0x8611):
                ...
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from catenary.model.device import Identity
from catenary.model.finding import Finding
from catenary.plan.stop_reason import StopReason
from catenary.wire import coe
from catenary.wire.drive_error import error_text

if TYPE_CHECKING:
    from catenary.bus.sub_device import SubDevice


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened."""

    time: float
    sub: SubDevice | None
    message: str

    def __str__(self) -> str:
        return f"{self.time:.3f} s: {self.message}"


@dataclass(frozen=True, slots=True)
class Emergency(Event):
    """A device reports a fault, or with error code 0 that it is gone: ETG.1000.6 §5.6.4."""

    error_code: int
    error_register: int  # object 0x1001
    data: bytes  # 5 bytes: its maker's

    @property
    def text(self) -> str:
        """What the error code means, by IEC 61800-7-201 and CiA 301."""
        return error_text(self.error_code)


@dataclass(frozen=True, slots=True)
class DeviceLost(Event):
    """A device does not answer any more."""


@dataclass(frozen=True, slots=True)
class DeviceReturned(Event):
    """A device that was lost answers again; the same one, by its identity."""


@dataclass(frozen=True, slots=True)
class DeviceReplaced(Event):
    """Another device stands where one was lost."""

    expected: Identity
    found: Identity


@dataclass(frozen=True, slots=True)
class DeviceHeld(Event):
    """A device that returned is not let into OP: by policy, or because bringing it there failed."""

    state: int  # AL state it is held in
    reason: str


@dataclass(frozen=True, slots=True)
class StateLost(Event):
    """A device left the state it was brought to, without being asked."""

    expected: int  # AL state
    state: int
    code: int  # AL status code


@dataclass(frozen=True, slots=True)
class LinkLost(Event):
    """A cable does not carry any more. `between`: the positions at its ends; None: the
    MainDevice."""

    between: tuple[int | None, int | None]


@dataclass(frozen=True, slots=True)
class LinkRestored(Event):
    """A cable carries again."""

    between: tuple[int | None, int | None]


@dataclass(frozen=True, slots=True)
class FaultFound(Event):
    """The error counters point at a cable, a device or its supply; frames may still come through.
    `sub`: the device, or the one behind the cable."""

    finding: Finding


@dataclass(frozen=True, slots=True)
class DuplicateFrames(Event):
    """Many cyclic frames came back more than once: suspect a loop in the wiring or a second
    sender. `sub` is None."""

    count: int  # of such frames in `interval`
    interval: float  # [s]


@dataclass(frozen=True, slots=True)
class ClockUnlocked(Event):
    """A device's clock left the bound it was held in."""

    difference: float  # from the reference clock [s]
    bound: float  # [s]


@dataclass(frozen=True, slots=True)
class ClockLocked(Event):
    """A device's clock is within the bound; `sub` None: all are."""

    difference: float  # from the reference clock, the largest where it is about all [s]
    bound: float  # [s]


@dataclass(frozen=True, slots=True)
class AxisStopped(Event):
    """The core stopped an axis, without a request of the application."""

    axis: str
    reason: StopReason
    cycle: int  # its number


@dataclass(frozen=True, slots=True)
class ModeRefused(Event):
    """A drive did not change to a requested mode; the axis continues in its former mode."""

    axis: str
    mode: int  # mode of operation 0x6060 that was requested


@dataclass(frozen=True, slots=True)
class Marker(Event):
    """The application marks an instant, to be found again among the cycles: `MainDevice.mark`."""


def emergency(time: float, sub: SubDevice, message: coe.Emergency) -> Emergency:
    """The event for a device's emergency message."""
    code, register = message.error_code, message.error_register
    what = (
        f"emergency 0x{code:04X} ({error_text(code)}), error register 0x{register:02X}"
        if code
        else "emergency gone (error code 0)"
    )
    rest = f", data {message.data.hex(' ')}" if any(message.data) else ""
    return Emergency(time, sub, f"{sub.station}: {what}{rest}", code, register, message.data)
