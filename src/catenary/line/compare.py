"""Comparison of two clones of a segment: what has changed since the earlier one.

    found = compare_lines(read_line("line/"), read_line("now/"))
    for change in found.changes:
        print(change)  # device 2 (AX5101): object 0x6065:00 Following error window: 5000 → 100

Values that always change are not compared: process data, system times, delays and receive times.
"""

from __future__ import annotations

from collections.abc import Iterator

from catenary.line.change import Change, Comparison, Part, Uncompared
from catenary.line.compare_mapping import compare_mapping
from catenary.line.compare_objects import compare_objects, missing_values
from catenary.line.compare_registers import compare_registers
from catenary.line.compare_sii import compare_sii, stored_alias
from catenary.line.compare_topology import compare_topology, identity_text
from catenary.line.pairing import pair_devices
from catenary.line.sides import Sides
from catenary.line.values import Line

IN_REGISTER = "register"
_SWITCHED = "not in the EEPROM: a switch was turned, or a new alias needed a power cycle"
_PARTS = {"sii": "EEPROM", "objects": "objects"}


def compare_lines(old: Line, new: Line) -> Comparison:
    """Return the differences between two clones.

    Args:
        old: The earlier clone, of the segment when it worked.
        new: The present clone.
    """
    pairing = pair_devices(old, new)
    serials = old.serials and new.serials
    changes = list(compare_topology(old, new, pairing))
    uncompared: list[Uncompared] = []
    for before, now in pairing.pairs:
        sides = Sides(old.devices[before], new.devices[now], serials)
        changes += _device(sides)
        uncompared += _uncompared(sides)
    changes.sort(key=lambda each: each.device.position)
    return Comparison(tuple(changes), tuple(uncompared), len(pairing.pairs))


def _device(sides: Sides) -> Iterator[Change]:
    old, new = sides.old.identity, sides.new.identity
    if old is not None and new is not None:
        if not old.same_kind(new):
            texts = identity_text(sides.old), identity_text(sides.new)
            yield sides.change(Part.DEVICE, "exchanged", texts)
            return  # another product: every part differs
        if old.revision != new.revision:
            texts = f"0x{old.revision:08X}", f"0x{new.revision:08X}"
            yield sides.change(Part.REVISION, "", texts)
        if sides.exchanged:
            texts = str(old.serial), str(new.serial)
            yield sides.change(Part.SERIAL, "", texts, note="the device was exchanged")
    if sides.old.sii is not None and sides.new.sii is not None:
        yield from compare_sii(sides)
    yield from _alias(sides)
    yield from compare_registers(sides)
    yield from compare_mapping(sides)
    yield from compare_objects(sides)


def _alias(sides: Sides) -> Iterator[Change]:
    """Yield a changed alias in the register, unless `compare_sii` reports that of the EEPROM."""
    texts = str(sides.old.alias), str(sides.new.alias)
    if texts[0] == texts[1]:
        return
    if sides.old.sii is None or sides.new.sii is None:
        yield sides.change(Part.ALIAS, "", texts)
    elif stored_alias(sides.old.sii) == stored_alias(sides.new.sii):
        yield sides.change(Part.ALIAS, IN_REGISTER, texts, note=_SWITCHED)


def _uncompared(sides: Sides) -> Iterator[Uncompared]:
    """Yield the parts that at least one clone does not have."""
    for part, name in _PARTS.items():
        old, new = sides.old.missing.get(part), sides.new.missing.get(part)
        has = sides.old.sii is not None if part == "sii" else bool(sides.old.objects)
        if new is not None and (has or old is not None):
            yield sides.uncompared(name, new, expected=has)
        elif new is None and old is not None:
            yield sides.uncompared(name, f"not in the earlier clone: {old}", expected=False)
    count, reason = missing_values(sides.old, sides.new)
    if count:
        yield sides.uncompared(f"{count} values", f"not read: {reason}", expected=True)
