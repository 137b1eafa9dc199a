"""Objects that a master wrote to one device, as a start-up list."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.capture.compared_master import ComparedMaster
from catenary.capture.difference import level
from catenary.capture.events import Device, Step
from catenary.capture.mapping_objects import ASSIGNMENTS, is_mapping
from catenary.capture.object_writes import Objects, ObjectWrite, objects_of
from catenary.wire.al import AlState

_NOT_READ_BACK = (0x1010, 0x1011)  # store and restore parameters: a read returns other values


@dataclass(frozen=True, slots=True)
class StartUpEntry:
    """One object. `value` is a number if the data has 1, 2, 4 or 8 bytes, else None.

    With complete access, the data belongs to several subindices, and `value` is None.
    """

    index: int
    subindex: int
    data: bytes
    step: Step
    packet: int
    before_mapping: bool = False
    verify: bool = True
    complete_access: bool = False

    @property
    def value(self) -> int | None:
        """The unsigned number; None for another length and for complete access."""
        is_number = len(self.data) in (1, 2, 4, 8) and not self.complete_access
        return int.from_bytes(self.data, "little") if is_number else None


@dataclass(frozen=True, slots=True)
class MappedEntry:
    """Entry of a PDO."""

    index: int
    subindex: int
    bits: int


@dataclass(frozen=True, slots=True)
class StartUpList:
    """Objects and PDOs that a master wrote to a device until OP.

    `pdos` has the assigned PDOs with their entries, None if the capture does not show them. It is
    empty if the master wrote no mapping. `omitted` explains writes that a list cannot contain.
    """

    device: Device
    entries: tuple[StartUpEntry, ...]
    pdos: dict[int, tuple[MappedEntry, ...] | None]
    omitted: tuple[str, ...]


def start_up_list(master: ComparedMaster, device: Device) -> StartUpList:
    """Return the start-up list of a device.

    Args:
        master: The master of the capture.
        device: One of its devices.
    """
    objects = objects_of(master.bring_up(device), level(AlState.OP))
    omitted: list[str] = []
    chosen: list[ObjectWrite] = []
    for write in objects.writes:
        reason = _reason_to_omit(write)
        if reason:
            omitted.append(f"{write}: {reason}")
        elif not is_mapping(write.index):
            if chosen and (chosen[-1].place, chosen[-1].data) == (write.place, write.data):
                chosen.pop()  # the master has repeated the write
            chosen.append(write)
    mapping = [each.packet for each in objects.writes if is_mapping(each.index)]
    first_mapping = min(mapping, default=0)
    last = {each.place: number for number, each in enumerate(chosen)}
    entries = tuple(
        StartUpEntry(
            *(each.index, each.subindex, each.data, each.step, each.packet),
            before_mapping=each.packet < first_mapping,
            verify=last[each.place] == number and each.index not in _NOT_READ_BACK,
            complete_access=each.complete,
        )
        for number, each in enumerate(chosen)
    )
    return StartUpList(device, entries, _pdos(objects) if mapping else {}, tuple(omitted))


def _reason_to_omit(write: ObjectWrite) -> str:
    """Return why a write is not part of a list; empty if it is."""
    if write.text:
        return "not CoE"
    if not write.answered:
        return "the capture lacks its answer or a segment"
    if not write.succeeded:
        return "the device did not accept it"
    if write.complete and write.subindex > 1:
        return "complete access must begin at subindex 0 or 1"
    return "" if write.data else "no data"


def _pdos(objects: Objects) -> dict[int, tuple[MappedEntry, ...] | None]:
    found: dict[int, tuple[MappedEntry, ...] | None] = {}
    for assignment in ASSIGNMENTS:
        for number in _numbers(objects, assignment) or ():
            packed = _numbers(objects, number)
            found[number] = None if packed is None else tuple(map(_mapped, packed))
    return found


def _numbers(objects: Objects, index: int) -> list[int] | None:
    """Return the entries of a mapping object; None if the capture does not show all of them."""
    count = objects.known.get(("CoE", index, 0))
    if not count:
        return None
    places = [("CoE", index, subindex) for subindex in range(1, count[0] + 1)]
    data = [objects.known.get(place) for place in places]
    return None if None in data else [int.from_bytes(each or b"", "little") for each in data]


def _mapped(packed: int) -> MappedEntry:
    return MappedEntry(packed >> 16 & 0xFFFF, packed >> 8 & 0xFF, packed & 0xFF)
