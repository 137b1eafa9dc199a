"""Choice of a description by revision."""

from __future__ import annotations

import pytest

from catenary.esi.device import DeviceKey, RevisionCheck
from catenary.esi.lookup import Rule, accepts, choose, hidden_keys
from catenary.esi.record import IndexEntry, Kind, Record

CHECK = RevisionCheck


def record(
    revision: int,
    check: RevisionCheck = CHECK.NONE,
    *,
    path: str = "a.xml",
    order: int = 0,
    hides: tuple[int, ...] = (),
    type: str = "",
) -> Record:
    keys = tuple(DeviceKey(1, 2, each) for each in hides)
    entry = IndexEntry(
        Kind.DEVICE,
        0,
        1,
        1,
        vendor=1,
        product=2,
        revision=revision,
        revision_check=check,
        hides=keys,
        type=type,
    )
    return Record(entry, path, "/", order)


@pytest.mark.parametrize(
    ("revisions", "device", "rule", "chosen"),
    [
        ((0x10, 0x12, 0x14), 0x12, Rule.EXACT, 0x12),
        ((0x10, 0x12, 0x14), 0x13, Rule.NOT_ABOVE, 0x12),
        ((0x10, 0x12, 0x14), 0xFF, Rule.NOT_ABOVE, 0x14),
        ((0x10, 0x12, 0x14), 0x0F, Rule.UNSUITABLE, None),
        ((0x10, 0x12, 0x14), None, Rule.NEWEST, 0x14),
        ((0x00120000, 0x00130001), 0x00130000, Rule.NOT_ABOVE, 0x00120000),
    ],
)
def test_the_newest_revision_that_is_not_above_is_chosen(
    revisions: tuple[int, ...], device: int | None, rule: Rule, chosen: int | None
) -> None:
    choice = choose([record(each) for each in revisions], device)
    assert choice is not None
    assert choice.rule is rule
    assert (choice.record and choice.record.entry.revision) == chosen
    assert [each.entry.revision for each in choice.candidates] == sorted(revisions, reverse=True)


def test_an_unknown_product_has_no_choice() -> None:
    assert choose([], 1) is None


@pytest.mark.parametrize(
    ("check", "device", "file", "accepted"),
    [
        (CHECK.NONE, 5, 4, True),
        (CHECK.NONE, 4, 5, False),
        (CHECK.EQUAL, 5, 4, False),
        (CHECK.EQUAL_OR_GREATER, 5, 4, True),
        (CHECK.LOW_EQUAL, 0x0001_0004, 0x0002_0004, True),
        (CHECK.LOW_EQUAL_OR_GREATER, 0x0001_0005, 0x0002_0004, True),
        (CHECK.LOW_EQUAL_OR_GREATER, 0x0003_0003, 0x0002_0004, False),
        (CHECK.LOW_EQUAL_HIGH_EQUAL_OR_GREATER, 0x0003_0004, 0x0002_0004, True),
        (CHECK.LOW_EQUAL_HIGH_EQUAL_OR_GREATER, 0x0001_0004, 0x0002_0004, False),
        (CHECK.HIGH_EQUAL, 0x0002_0001, 0x0002_0004, True),
        (CHECK.HIGH_EQUAL_OR_GREATER, 0x0003_0001, 0x0002_0004, True),
        (CHECK.HIGH_EQUAL_LOW_EQUAL_OR_GREATER, 0x0002_0005, 0x0002_0004, True),
        (CHECK.HIGH_EQUAL_LOW_EQUAL_OR_GREATER, 0x0003_0005, 0x0002_0004, False),
    ],
)
def test_each_rule_of_the_vendor(
    check: RevisionCheck, device: int, file: int, accepted: bool
) -> None:
    assert accepts(check, device, file) is accepted


def test_every_rule_has_a_function() -> None:
    assert all(accepts(each, 1, 1) for each in RevisionCheck)


def test_the_rule_of_the_vendor_decides_among_revisions_that_are_not_above() -> None:
    known = [record(0x0002_0004, CHECK.LOW_EQUAL), record(0x0001_0005, CHECK.LOW_EQUAL)]
    choice = choose(known, 0x0003_0005)
    assert choice is not None
    assert choice.record is known[1]


def test_a_refused_revision_is_used_if_there_is_no_other() -> None:
    choice = choose([record(4, CHECK.EQUAL), record(3, CHECK.EQUAL)], 5)
    assert choice is not None
    assert choice.record is not None
    assert (choice.rule, choice.record.entry.revision) == (Rule.REFUSED, 4)


def test_a_newer_revision_is_used_if_its_rule_accepts_the_device() -> None:
    known = [record(0x0003_0004, CHECK.LOW_EQUAL), record(0x0002_0004, CHECK.LOW_EQUAL)]
    choice = choose(known, 0x0001_0004)
    assert choice is not None
    assert choice.record is known[1]
    assert choice.rule is Rule.ACCEPTED


def test_hidden_revisions_are_used_for_devices_but_not_without_a_revision() -> None:
    known = [record(1), record(2, hides=(1, 2))]
    assert hidden_keys(known) == {DeviceKey(1, 2, 1)}
    exact, newest = choose(known, 1), choose([record(3), record(2, hides=(3,))], None)
    assert exact is not None
    assert exact.record is known[0]
    assert newest is not None
    assert newest.record is not None
    assert newest.record.entry.revision == 2


def test_the_source_that_was_added_last_is_preferred() -> None:
    known = [record(1, path="a.xml"), record(1, path="c.xml", order=1), record(1, path="b.xml")]
    choice = choose(known, 1)
    assert choice is not None
    assert [each.path for each in choice.records] == ["c.xml", "a.xml", "b.xml"]


def test_the_order_code_decides_between_equal_numbers() -> None:
    known = [record(2, type="A"), record(1, type="A"), record(1, type="B")]
    choice = choose(known, 1, "B")
    assert choice is not None
    assert [each.entry.type for each in choice.records] == ["B", "A"]
