"""Parts that the present clone could not read: they are not differences."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.line import ClonedDevice, ClonedEntry, ClonedObject, ClonedPdo
from catenary.line.change import Part
from catenary.line.compare import compare_lines
from catenary.types import UDINT
from tests.line.clones import one_device
from tests.line.test_compare import (
    READ,
    WRITE,
    assigned,
    clone,
    entry,
    header,
    mapping,
    objects,
    only,
    seen,
)


def not_compared(old: ClonedDevice, new: ClonedDevice) -> str:
    """Return the only part that was not compared, after the device. Nothing has changed."""
    found = compare_lines(clone(old), clone(new))
    assert (found.changes, found.unread) == ((), True)
    [part] = found.uncompared
    return f"{part.part}: {part.reason}"


def record(*entries: ClonedEntry, code: int = 9, reason: str = "") -> ClonedDevice:
    found = ClonedObject(0x2000, code, 0x23, 2, "Limits" if code else "", entries, reason)
    return assigned(values=(found,))


def at(subindex: int, value: bytes | None = bytes(4), **more: object) -> ClonedEntry:
    return replace(entry(0x2000, value), subindex=subindex, **more)


def test_an_entry_whose_description_was_not_read_is_no_difference() -> None:
    reason = "0x02 is not described: no answer"
    text = not_compared(record(at(1), at(2)), record(at(1), reason=reason))
    assert text == f"1 values: not read: 0x2000: {reason}"


def test_a_description_that_was_not_read_is_no_difference() -> None:
    plain = replace(at(0), access=READ & 0, data_type=0, bit_length=0)
    text = not_compared(record(at(0), at(1)), record(plain, code=0, reason="no answer"))
    assert text == "1 values: not read: 0x2000: no answer"


def test_a_value_without_its_description_keeps_its_severity() -> None:
    plain = replace(at(0, b"\1\0\0\0"), access=READ & 0, data_type=0, bit_length=0)
    change = only(record(at(0)), record(plain, code=0, reason="no answer"))
    assert seen(change) == ("object", "0x2000:00", "0", "1", "effect")
    assert change.entry is not None
    assert (change.entry.type, change.entry.writable) == ("UDINT", True)


def test_a_mapping_that_was_read_in_part_is_not_compared() -> None:
    whole = mapping(0x1600, 0x6040_0010, 0x607A_0020)
    count, first, second = whole.entries
    part = replace(whole, entries=(count, first, replace(second, value=None, reason="no answer")))
    pdo = ClonedPdo(0x1600, ())
    text = not_compared(assigned(pdo, values=(whole,)), assigned(pdo, values=(part,)))
    assert text == "1 values: not read: 0x1600:02: no answer"


@pytest.mark.parametrize("abort", [None, 0x0800_0000])
def test_an_assignment_that_was_not_read_is_no_difference(abort: int | None) -> None:
    """The reading ended before the assignment. A refusal is a difference."""
    other = objects(entry(0x1000, bytes(4), READ))
    count = ClonedEntry(0x1C12, 0, 5, 8, READ | WRITE, "", b"\1")
    place = ClonedEntry(0x1C12, 1, UDINT.index, 16, READ | WRITE, "", b"\0\x16")
    listing = ClonedObject(0x1C12, 8, 6, 1, "RxPDO assign", (count, place))
    old = assigned(ClonedPdo(0x1600, ()), values=(*other, listing))
    new = replace(old, objects=other, assignments=(), mapping_source="SII")
    if abort is None:
        new = replace(new, missing={"objects": "reading ended"})
        assert not_compared(old, new) == "objects: reading ended"
        return
    refused = replace(listing, entries=(replace(count, value=None, abort=abort),))
    change = only(old, replace(new, objects=(*other, refused)))
    assert seen(change) == ("assignment", "SyncManager 2", "0x1600", "-", "effect")


def test_the_alias_of_a_switch_is_compared() -> None:
    """The register has another alias, and the EEPROM has the same."""
    change = only(one_device(alias=3), one_device(alias=5))
    assert seen(change) == ("alias", "register", "3", "5", "effect")
    assert "switch" in change.note


def test_an_alias_in_eeprom_and_register_is_one_change() -> None:
    change = only(header(station_alias=3), replace(header(station_alias=9), alias=9))
    assert (change.part, change.what, change.old, change.new) == (Part.ALIAS, "", "3", "9")
