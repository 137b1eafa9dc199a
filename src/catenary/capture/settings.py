"""Registers that a bring-up leaves in a device, as values that can be compared.

Only the last value counts: masters clear SyncManagers and FMMUs at different moments. Logical
addresses, numbers of FMMUs and start times are choices of the master, so they are no part of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

from catenary.capture.contents import Content
from catenary.capture.difference import Topic, level
from catenary.capture.events import Event, Step
from catenary.capture.mapped_areas import MappedArea, mapped_areas
from catenary.capture.register_contents import (
    FmmuWrite,
    RegisterWrite,
    SyncManagerWrite,
    SyncUnitWrite,
)
from catenary.wire.clock import Activation
from catenary.wire.fmmu import Fmmu
from catenary.wire.register import (
    DIGITAL_OUTPUTS,
    GENERAL_PURPOSE_OUTPUTS,
    LATCH0_CONTROL,
    LATCH1_CONTROL,
    SYNC0_CYCLE_TIME,
    SYNC1_CYCLE_TIME,
    SYNC_CYCLE_TIMES,
    SYNC_PULSE_LENGTH,
    WATCHDOG_DIVIDER,
    WATCHDOG_TIME_PDI,
    WATCHDOG_TIME_PROCESS_DATA,
)
from catenary.wire.sync_manager import Buffering

_MODE = 0x03  # of a SyncManager's control byte
# Other registers are not compared: ports, event masks, error counters, EEPROM and PHY interfaces,
# and the time loop of the clock, which differ from run to run or do not change process data.
_COMPARED: dict[int, Topic] = {
    WATCHDOG_DIVIDER.address: Topic.WATCHDOG,
    WATCHDOG_TIME_PDI.address: Topic.WATCHDOG,
    WATCHDOG_TIME_PROCESS_DATA.address: Topic.WATCHDOG,
    SYNC_PULSE_LENGTH.address: Topic.CLOCK,
    LATCH0_CONTROL.address: Topic.CLOCK,
    LATCH1_CONTROL.address: Topic.CLOCK,
    DIGITAL_OUTPUTS.address: Topic.REGISTER,
    GENERAL_PURPOSE_OUTPUTS.address: Topic.REGISTER,
}


@dataclass(frozen=True, slots=True)
class SyncUnit:
    """SYNC unit without its start time. A cycle time is 0 if its pulse is off."""

    assign_activate: int
    sync0_ns: int
    sync1_ns: int


Value: TypeAlias = SyncManagerWrite | MappedArea | SyncUnit | RegisterWrite


@dataclass(frozen=True, slots=True)
class Setting:
    """The last value of a register block, with the step and packet of its first write."""

    key: tuple[str, int]
    topic: Topic
    value: Value
    step: Step
    packet: int


def settings_of(events: Iterable[Event], limit: int) -> dict[tuple[str, int], Setting]:
    """Return the settings of a device by their keys, without those that are off.

    Args:
        events: Events until the end of the bring-up.
        limit: Rank of the highest state in which a write counts.
    """
    registers = _Registers()
    for event in events:
        if level(event.step.before) <= limit and getattr(event.content, "accepted", False):
            registers.store(event)
    return {each.key: each for each in registers.settings()}


class _Registers:
    """Owner of the last writes of one device."""

    def __init__(self) -> None:
        self._written: dict[tuple[str, int], tuple[Content, Event]] = {}
        self._fmmus: dict[int, tuple[Fmmu, Event]] = {}
        self._times = bytearray(SYNC_CYCLE_TIMES.size)
        self._active: tuple[int, Event] | None = None

    def store(self, event: Event) -> None:
        content = event.content
        if isinstance(content, SyncManagerWrite):
            self._keep(("SM", content.number), event)
        elif isinstance(content, FmmuWrite):
            known = self._fmmus.get(content.number)
            if known is None or known[0] != content.fmmu:
                self._fmmus[content.number] = content.fmmu, event
        elif isinstance(content, SyncUnitWrite):
            self._times[:] = SYNC0_CYCLE_TIME.pack(content.sync0_ns) + SYNC1_CYCLE_TIME.pack(
                content.sync1_ns
            )
            if self._active is None or self._active[0] != content.assign_activate:
                self._active = content.assign_activate, event
        elif isinstance(content, RegisterWrite):
            self._store_times(content)
            if content.address in _COMPARED:
                self._keep(("register", content.address), event)

    def settings(self) -> Iterator[Setting]:
        """Yield the settings that are on, SyncManagers first."""
        for key, (content, event) in sorted(self._written.items(), key=lambda each: each[0]):
            if isinstance(content, SyncManagerWrite):
                if content.enabled:
                    yield Setting(key, _topic_of(content), content, event.step, event.packet)
            elif isinstance(content, RegisterWrite):
                topic = _COMPARED[content.address]
                yield Setting(key, topic, content, event.step, event.packet)
        for key, area, event in mapped_areas(self._fmmus.values()):
            yield Setting(key, Topic.FMMU, area, event.step, event.packet)
        unit = self._sync_unit()
        if unit is not None and self._active is not None:
            event = self._active[1]
            yield Setting(("SYNC", 0), Topic.CLOCK, unit, event.step, event.packet)

    def _keep(self, key: tuple[str, int], event: Event) -> None:
        known = self._written.get(key)
        if known is None or known[0] != event.content:
            self._written[key] = event.content, event

    def _store_times(self, content: RegisterWrite) -> None:
        """Store the part of a write that covers the cycle times."""
        for offset, byte in enumerate(content.data, content.address - SYNC_CYCLE_TIMES.address):
            if 0 <= offset < SYNC_CYCLE_TIMES.size:
                self._times[offset] = byte

    def _sync_unit(self) -> SyncUnit | None:
        if self._active is None:
            return None
        active = Activation(self._active[0] >> 8)
        if Activation.CYCLIC_OPERATION not in active:
            return None
        sync0, sync1 = (int.from_bytes(self._times[i : i + 4], "little") for i in (0, 4))
        return SyncUnit(self._active[0], sync0, sync1 if Activation.SYNC1 in active else 0)


def _topic_of(content: SyncManagerWrite) -> Topic:
    is_mailbox = content.control & _MODE == Buffering.MAILBOX
    return Topic.MAILBOX if is_mailbox else Topic.SYNC_MANAGER
