"""Events of a timeline, and the devices and masters that they refer to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from catenary.capture.contents import Content
from catenary.wire.al import AlState

_NEXT = {
    AlState.INIT: AlState.PRE_OP,
    AlState.PRE_OP: AlState.SAFE_OP,
    AlState.SAFE_OP: AlState.OP,
}
_SHORT = {AlState.PRE_OP: "PRE", AlState.SAFE_OP: "SAFE"}


@dataclass(frozen=True, slots=True)
class Step:
    """A state of a device, or a transition between two states.

    Requests, SDOs and mailbox messages belong to a state, or to the transition while it lasts.
    SyncManagers, FMMUs, clocks and other registers prepare the next transition: in PRE-OP, they
    belong to PRE→SAFE. A state is None while it is unknown.
    """

    before: AlState | None = None
    after: AlState | None = None

    def __str__(self) -> str:
        if self.before is self.after:
            return "-" if self.before is None else str(self.before)
        return "→".join(
            "?" if state is None else _SHORT.get(state, str(state))
            for state in (self.before, self.after)
        )


UNKNOWN_STEP = Step()


def step_of(state: AlState | None, requested: AlState | None, *, configures: bool = False) -> Step:
    """Return the step of an event.

    Args:
        state: The last known state of the device.
        requested: The last requested state.
        configures: True for a register that prepares the next transition.
    """
    if requested is not None and requested is not state:
        return Step(state, requested)
    if configures and state is not None:
        return Step(state, _NEXT.get(state, state))
    return Step(state, state)


def common_step(steps: Iterable[Step]) -> Step:
    """Return the step of several devices, with None for a state that differs among them."""
    befores, afters = set(), set()
    for step in steps:
        befores.add(step.before)
        afters.add(step.after)
    before = befores.pop() if len(befores) == 1 else None
    return Step(before, afters.pop() if len(afters) == 1 else None)


@dataclass(frozen=True, slots=True)
class Event:
    """One event of a timeline.

    `device` is an index in `Timeline.devices` of the master; None for all devices (broadcasts),
    for the segment and for the frames. `packet` is the number of the packet in the file, from 1.
    """

    time_ns: int  # since the first packet of the file
    packet: int
    master: int  # index in Timeline.masters
    device: int | None
    step: Step
    content: Content


@dataclass(frozen=True, slots=True)
class Device:
    """A device as a master has addressed it. None: the capture does not show this value."""

    number: int  # in the order of appearance, from 0
    position: int | None = None
    station: int | None = None
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str = ""
    order: str = ""  # order code in the EEPROM
    state: AlState | None = None

    def __str__(self) -> str:
        place = self.number if self.position is None else self.position
        name = self.order or self.name
        if name:
            return f"{place} {name}"
        return f"{place}" if self.station is None else f"{place} (0x{self.station:04X})"


@dataclass(frozen=True, slots=True)
class Master:
    """A source address that sends EtherCAT frames."""

    number: int
    source: bytes  # MAC address, without the bit that controllers set
    name: str = ""  # "TwinCAT", "SOEM", ...; empty if the frames do not show it
    sent: int = 0
    returned: int = 0
    lost: int = 0  # sent frames without an answer
    started_ns: int = 0
    ended_ns: int = 0

    def __str__(self) -> str:
        source = self.source.hex(":")
        return f"{self.name} (source {source})" if self.name else f"source {source}"
