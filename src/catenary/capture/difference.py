"""Differences of two captures: frozen rows, and what they concern."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from catenary.capture.events import Device, Event, Step
from catenary.wire.al import AlState

_LEVELS = (AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP)


def level(state: AlState | None) -> int:
    """Return the rank of a state on the way to OP: 0 for INIT, BOOT and an unknown state."""
    return _LEVELS.index(state) if state in _LEVELS else 0


def state_of(rank: int) -> AlState:
    """Return the state with a rank."""
    return _LEVELS[rank]


class Mark(Enum):
    """Kind of a row."""

    ONLY_A = "only in A"
    ONLY_B = "only in B"
    DIFFERS = "differs"
    ORDER = "order"
    RESULT = "result"  # a state that only one of the captures reaches


class Topic(Enum):
    """Part of the configuration that a row concerns."""

    DEVICE = "device"
    MAILBOX = "mailbox"
    MAPPING = "mapping"  # PDO mapping and assignment
    OBJECT = "object"
    SYNC_MANAGER = "SyncManager"
    FMMU = "FMMU"
    CLOCK = "clock"
    WATCHDOG = "watchdog"
    REGISTER = "register"
    STATE = "state"


@dataclass(frozen=True, slots=True)
class Difference:
    """One row: the same step in both captures.

    `a` and `b` are texts, empty if the capture has no such step. `effect` is True if the
    difference changes what the device does. `packet_a` and `packet_b` are packet numbers.
    """

    mark: Mark
    topic: Topic
    subject: str  # name of the differing value, such as AssignActivate
    step: Step
    a: str
    b: str
    effect: bool = True
    note: str = ""
    packet_a: int | None = None
    packet_b: int | None = None

    @property
    def remark(self) -> str:
        """The mark with its note, such as `only in A: B read this value`."""
        if self.mark is Mark.DIFFERS or self.mark is Mark.RESULT:
            return self.note or self.mark.value
        return f"{self.mark.value}: {self.note}" if self.note else self.mark.value


def mark_of(a: object, b: object) -> Mark:
    """Return the mark of a difference between two values, of which one may be missing.

    Args:
        a: Value in A; None if it is missing.
        b: Value in B; None if it is missing.
    """
    if b is None:
        return Mark.ONLY_A
    return Mark.ONLY_B if a is None else Mark.DIFFERS


@dataclass(frozen=True, slots=True)
class DevicePair:
    """A device in both captures. One of them is None if the device has no counterpart."""

    a: Device | None
    b: Device | None

    @property
    def device(self) -> Device:
        """The device in A, else in B."""
        found = self.a or self.b
        assert found is not None
        return found


@dataclass(frozen=True, slots=True)
class DeviceComparison:
    """The rows of one device. `registers` and `objects` count the compared writes of A."""

    pair: DevicePair
    rows: tuple[Difference, ...]
    registers: int = 0
    objects: int = 0
    error_a: Event | None = None
    error_b: Event | None = None
