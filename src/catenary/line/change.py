"""Differences between two clones of a segment."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

ABSENT = "-"  # text of a value that one side does not have


class Severity(StrEnum):
    """Effect of a change."""

    EFFECT = "effect"  # changes what a device does
    FAULT = "fault"  # counted errors, or a device that reports an error
    INFO = "info"  # does not change what a device does
    VARIABLE = "variable"  # value that changes by itself, such as a process value


class Part(StrEnum):
    """Part of a device that changed."""

    DEVICE = "device"  # the device itself: missing, added or exchanged
    TOPOLOGY = "topology"
    REVISION = "revision"
    SERIAL = "serial"
    ALIAS = "alias"
    STATE = "state"
    SII = "SII"
    REGISTER = "register"
    CLOCK = "clock"
    ERRORS = "error counters"
    ASSIGNMENT = "assignment"
    MAPPING = "mapping"
    OBJECT = "object"


@dataclass(frozen=True, slots=True)
class ChangedDevice:
    """A device with its positions; None on the side that does not have it."""

    name: str
    old: int | None
    new: int | None

    @property
    def position(self) -> int:
        """Present position, or the earlier one of a missing device."""
        return self.new if self.new is not None else self.old or 0

    def __str__(self) -> str:
        if self.new is None:
            return f"earlier device {self.old} ({self.name})"
        return f"device {self.new} ({self.name})"


@dataclass(frozen=True, slots=True)
class ChangedEntry:
    """Entry of a dictionary with a changed value."""

    index: int
    subindex: int
    type: str
    old: bytes | None  # the earlier value; None if it was not readable
    writable: bool  # True if it can be written in PRE-OP


@dataclass(frozen=True, slots=True)
class Change:
    """One difference: `old` is the earlier value as text, `new` the present one."""

    device: ChangedDevice
    part: Part
    what: str  # such as "0x6065 Following error window" or "port 1: invalid frames"
    old: str
    new: str
    severity: Severity
    note: str = ""  # meaning of the change, or what to do
    entry: ChangedEntry | None = None  # for values of objects

    def __str__(self) -> str:
        what = f" {self.what}" if self.what else ""
        return f"{self.device}: {self.part}{what}: {self.old} → {self.new}"


@dataclass(frozen=True, slots=True)
class Uncompared:
    """A part that was not compared, with the reason."""

    device: ChangedDevice
    part: str  # "SII", "objects", "registers of the configuration" ...
    reason: str
    expected: bool = False  # True if the earlier clone has this part

    def __str__(self) -> str:
        return f"{self.device}: {self.part}: {self.reason}"


@dataclass(frozen=True, slots=True)
class Comparison:
    """Result of `compare_lines`, in the order of the devices."""

    changes: tuple[Change, ...]
    uncompared: tuple[Uncompared, ...]
    compared: int = 0  # number of devices that both clones have

    @property
    def different(self) -> bool:
        """True if a change affects a device, or errors were counted."""
        return any(each.severity in (Severity.EFFECT, Severity.FAULT) for each in self.changes)

    @property
    def unread(self) -> bool:
        """True if a part of the earlier clone could not be compared."""
        return any(each.expected for each in self.uncompared)
