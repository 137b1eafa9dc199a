"""Clock settings of a plan, for `print(plan.clocks)`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

from catenary.plan.clocks import SyncPlan
from catenary.plan.cycle import ClockPlan
from catenary.plan.report import clock_lines
from catenary.plan.start_up import DevicePlan
from catenary.wire.clock import Activation


@dataclass(frozen=True, slots=True)
class DeviceClock:
    """SYNC signals of one device, and the source of these settings."""

    position: int
    name: str
    sync: SyncPlan

    def __str__(self) -> str:
        sync = self.sync
        parts = [
            f"AssignActivate 0x{sync.assign_activate:04X}",
            f"SYNC0 {sync.cycle_ns / 1e6:g} ms",
            f"shift {sync.shift_ns / 1e3:+g} us",
        ]
        if Activation.SYNC1 in sync.activation:
            parts.append(f"SYNC1 {sync.sync1_ns / 1e3:g} us after SYNC0")
        if sync.op_mode:
            parts.append(f"OpMode {sync.op_mode!r}")
        parts.append(f"source: {sync.source or 'default of Catenary, or options of dc='}")
        return f"device {self.position} ({self.name}): {', '.join(parts)}"


class Clocks(Sequence[DeviceClock]):
    """Devices with SYNC signals, by position. `print` shows them and the reference clock."""

    def __init__(
        self, devices: Sequence[DevicePlan], clock: ClockPlan | None, period_ns: int
    ) -> None:
        self._clocks = tuple(
            DeviceClock(each.position, each.name, each.sync)
            for each in devices
            if each.sync is not None
        )
        self._lines = () if clock is None else tuple(clock_lines(clock, period_ns, devices))

    @overload
    def __getitem__(self, key: int) -> DeviceClock: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[DeviceClock, ...]: ...
    def __getitem__(self, key: int | slice) -> DeviceClock | tuple[DeviceClock, ...]:
        return self._clocks[key]

    def __len__(self) -> int:
        return len(self._clocks)

    def __iter__(self) -> Iterator[DeviceClock]:
        return iter(self._clocks)

    def __str__(self) -> str:
        return "\n".join((*map(str, self._clocks), *self._lines)) or "no distributed clocks"

    __repr__ = __str__
