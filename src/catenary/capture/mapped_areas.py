"""Memory of a device that its FMMUs map, without the numbers and logical addresses of the FMMUs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from catenary.capture.events import Event
from catenary.wire.fmmu import Fmmu
from catenary.wire.register import SYNC_MANAGER_COUNT, sync_manager

_SYNC_MANAGERS = range(
    sync_manager(0).address, sync_manager(SYNC_MANAGER_COUNT - 1).address + sync_manager(0).size
)


@dataclass(frozen=True, slots=True)
class MappedArea:
    """Consecutive bits of the memory. Adjacent FMMUs of one direction are one area."""

    reads: bool  # inputs: from the device
    writes: bool  # outputs: to the device
    first_bit: int  # 8 * address + bit
    bits: int

    @property
    def is_status(self) -> bool:
        """True for the status of a SyncManager, which masters map to see a full mailbox."""
        return self.reads and not self.writes and self.first_bit // 8 in _SYNC_MANAGERS

    def __str__(self) -> str:
        uses = "+".join(name for on, name in ((self.reads, "in"), (self.writes, "out")) if on)
        address, bit = divmod(self.first_bit, 8)
        if bit or self.bits % 8:
            return f"FMMU {uses or 'unused'} 0x{address:04X}:{bit} len {self.bits} bits"
        return f"FMMU {uses or 'unused'} 0x{address:04X} len {self.bits // 8}"


def mapped_areas(
    fmmus: Iterable[tuple[Fmmu, Event]],
) -> Iterator[tuple[tuple[str, int], MappedArea, Event]]:
    """Yield the areas with keys that are equal in two captures, and the write of the first FMMU.

    The areas of one direction are numbered by their addresses. The status of SyncManagers has a
    separate numbering.

    Args:
        fmmus: The last values of the FMMUs, with their writes.
    """
    merged: list[tuple[MappedArea, Event]] = []
    for area, event in sorted(_areas(fmmus), key=lambda each: _order(each[0])):
        joined = _join(merged[-1][0], area) if merged else None
        if joined is None:
            merged.append((area, event))
        else:
            merged[-1] = joined, merged[-1][1]
    numbers: dict[str, int] = defaultdict(int)
    for area, event in merged:
        kind = f"FMMU {area.is_status} {area.reads} {area.writes}"
        yield (kind, numbers[kind]), area, event
        numbers[kind] += 1


def _areas(fmmus: Iterable[tuple[Fmmu, Event]]) -> Iterator[tuple[MappedArea, Event]]:
    for fmmu, event in fmmus:
        if fmmu.enabled and fmmu.length:
            first = 8 * fmmu.physical_address + fmmu.physical_start_bit
            yield MappedArea(fmmu.reads, fmmu.writes, first, max(fmmu.bit_length, 1)), event


def _order(area: MappedArea) -> tuple[bool, bool, int, int]:
    return area.reads, area.writes, area.first_bit, area.bits


def _join(a: MappedArea, b: MappedArea) -> MappedArea | None:
    """Return both areas as one; None if they are not adjacent."""
    same = (a.reads, a.writes, a.is_status) == (b.reads, b.writes, b.is_status)
    if not same or a.first_bit + a.bits != b.first_bit:
        return None
    return MappedArea(a.reads, a.writes, a.first_bit, a.bits + b.bits)
