"""Variables of the process image, found among the PDO entries of the devices."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from catenary.esi.device import EsiEntry
from catenary.esi.eni.values import EniDevice, EniFile, EniSyncManager, ImagePart, Variable
from catenary.model.device import Direction

NUMBER_BITS = 64  # longest number in the process data


class PlacedVariable(NamedTuple):
    """Variable with the PDO entry at its bits."""

    variable: Variable
    device: int  # position
    pdo: int
    entry: EsiEntry


class Variables(NamedTuple):
    """Variables of a file, and those that cannot be exchanged with the reason."""

    placed: tuple[PlacedVariable, ...]
    left_out: dict[str, str]  # reason by name

    def by_device(self) -> dict[int, list[PlacedVariable]]:
        """Return the placed variables by the positions of their devices."""
        found: dict[int, list[PlacedVariable]] = {}
        for each in self.placed:
            found.setdefault(each.device, []).append(each)
        return found


def place_variables(eni: EniFile) -> Variables:
    """Return the PDO entry of each variable.

    A variable without an entry of its length at its bits is left out. Configurators add such
    variables for states of their own ("WcState"), and for parts of an entry.

    Args:
        eni: The file.
    """
    entries = {
        (direction, bit, entry.bit_length): (device.position, pdo, entry)
        for device in eni.devices
        for direction in Direction
        for pdo, entry, bit in _entry_bits(device, direction)
        if entry.index and entry.bit_length
    }
    owners = {direction: _Owners(eni, direction) for direction in Direction}
    placed: list[PlacedVariable] = []
    left_out: dict[str, str] = {}
    for each in eni.variables:
        found = entries.get((each.direction, each.bit_offset, each.bit_length))
        if found is None:
            left_out[each.name] = owners[each.direction].reason(each)
        elif each.bit_length > NUMBER_BITS:
            left_out[each.name] = f"it has {each.bit_length} bits; a number has at most 64"
        else:
            placed.append(PlacedVariable(each, *found))
    return Variables(tuple(placed), left_out)


def _entry_bits(device: EniDevice, direction: Direction) -> Iterator[tuple[int, EsiEntry, int]]:
    """Yield the entries of a device with their PDOs and bits in the image."""
    managers = device.managers(direction)
    for manager, start in zip(managers, _starts(managers, device.image(direction)), strict=False):
        bit = start
        for pdo in manager.pdos:
            for entry in pdo.entries:
                yield pdo.index, entry, bit
                bit += entry.bit_length


def _starts(managers: Sequence[EniSyncManager], parts: Sequence[ImagePart]) -> list[int]:
    """Return the first bit of each SyncManager: one part for each, or one part for all."""
    if len(parts) == len(managers):
        return [part.bit_start for part in parts]
    if len(parts) != 1:
        return []
    starts, bit = [], parts[0].bit_start
    for manager in managers:
        starts.append(bit)
        bit += (manager.bit_length + 7) // 8 * 8
    return starts


class _Owners:
    """Devices by their bits in the image of a direction."""

    def __init__(self, eni: EniFile, direction: Direction) -> None:
        parts = [
            (part.bit_start, part.bit_start + part.bit_length, device.name)
            for device in eni.devices
            for part in device.image(direction)
        ]
        self._parts = sorted(parts)
        self._starts = [start for start, _, _ in self._parts]

    def reason(self, variable: Variable) -> str:
        """Return the reason why a variable has no PDO entry."""
        first, end = variable.bit_offset, variable.bit_offset + variable.bit_length
        last = bisect_left(self._starts, end) - 1
        if last >= 0 and first < self._parts[last][1]:
            return (
                f"it covers bits {first} to {end - 1} of the image, where "
                f"{self._parts[last][2]!r} has no PDO entry of this length"
            )
        return "it is a state of the configurator's MainDevice, not process data of a device"
