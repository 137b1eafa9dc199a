"""Search for PDOs that carry the requested objects, with alternatives of real devices."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Direction, Entry, Pdo
from catenary.plan.pdo_search import (
    Combination,
    any_carries,
    conflict,
    explain_failure,
    find_combination,
)
from catenary.plan.request import ObjectReference


def pdo(index: int, *objects: tuple[int, int, int], **options: object) -> Pdo:
    entries = tuple(Entry(*each) for each in objects)
    return Pdo(index, entries, None, **options)  # type: ignore[arg-type]


def wants(*objects: tuple[int, int, int]) -> list[ObjectReference]:
    return [ObjectReference(*each) for each in objects]


def indices(found: Combination | None) -> list[int] | None:
    return None if found is None else [each.index for each in found.pdos]


# Beckhoff EL3002: standard and compact, by channel (infosys.beckhoff.com, el30xx).
STANDARD = [
    pdo(0x1A00 + 2 * k, (0x6000 + 16 * k, 1, 16), (0x6000 + 16 * k, 0x11, 16)) for k in (0, 1)
]
COMPACT = [pdo(0x1A01 + 2 * k, (0x6000 + 16 * k, 0x11, 16)) for k in (0, 1)]
EL3002 = sorted([*STANDARD, *COMPACT], key=lambda each: each.index)

CONTROL, POSITION, VELOCITY = (0x6040, 0, 16), (0x607A, 0, 32), (0x60FF, 0, 32)


def test_assigned_pdos_stay() -> None:
    found = find_combination(STANDARD, EL3002, wants((0x6010, 0x11, 16)))
    assert found == Combination(tuple(STANDARD))


def test_alternatives_are_exchanged_for_their_own_channel_only() -> None:
    found = find_combination(COMPACT, EL3002, wants((0x6000, 1, 16), (0x6010, 0x11, 16)))
    assert indices(found) == [0x1A00, 0x1A03]
    assert found is not None
    assert [each.index for each in found.removed] == [0x1A01]


def test_a_pdo_is_added_rather_than_exchanged() -> None:
    offered = [pdo(0x1A00, (1, 0, 8)), pdo(0x1A01, (1, 0, 8), (2, 0, 8)), pdo(0x1A02, (2, 0, 8))]
    assert indices(find_combination(offered[:1], offered, wants((2, 0, 8)))) == [0x1A00, 0x1A02]


def test_one_pdo_is_added_rather_than_two() -> None:
    offered = [
        pdo(0x1A00, (1, 0, 8)),
        pdo(0x1A01, (2, 0, 8)),
        pdo(0x1A02, (3, 0, 8)),
        pdo(0x1A03, (2, 0, 8), (3, 0, 8)),
    ]
    found = find_combination(offered[:1], offered, wants((2, 0, 8), (3, 0, 8)))
    assert indices(found) == [0x1A00, 0x1A03]


def test_a_mandatory_pdo_is_not_exchanged() -> None:
    offered = [pdo(0x1600, CONTROL, POSITION, mandatory=True), pdo(0x1601, CONTROL, VELOCITY)]
    wanted = wants(CONTROL, VELOCITY)
    assert find_combination(offered[:1], offered, wanted) is None
    reason = explain_failure(offered[:1], offered, wanted)
    assert "0x60FF:00 (32 bits) is in 0x1601" in reason
    assert "mandatory" in reason


def test_an_exclusion_is_obeyed_without_a_common_object() -> None:
    offered = [
        pdo(0x1A00, (1, 0, 8)),
        pdo(0x1A01, (2, 0, 8), excludes=frozenset((0x1A00,))),
        pdo(0x1A02, (1, 0, 8), (3, 0, 8)),
    ]
    assert conflict(offered[0], offered[1])
    assert indices(find_combination(offered[:1], offered, wants((2, 0, 8)))) == [0x1A01]
    both = find_combination(offered[:1], offered, wants((1, 0, 8), (2, 0, 8)))
    assert indices(both) == [0x1A01, 0x1A02]


def test_the_length_counts() -> None:
    offered = [pdo(0x1A00, (1, 0, 16)), pdo(0x1A01, (1, 0, 32))]
    assert indices(find_combination(offered[:1], offered, wants((1, 0, 32)))) == [0x1A01]


def test_an_object_that_no_pdo_carries_is_named() -> None:
    assert find_combination([], EL3002, wants((0x6020, 1, 16))) is None
    assert explain_failure([], EL3002, wants((0x6020, 1, 16))) == (
        "none of its PDOs carries 0x6020:01 (16 bits)"
    )


def test_pdos_of_one_object_that_are_assigned_together_stay_together() -> None:
    """EL3632: 0x6000:02 is mapped twice with different sizes."""
    twice = [pdo(0x1A00, (0x6000, 2, 16)), pdo(0x1A01, (0x6000, 2, 32))]
    offered = [*twice, pdo(0x1A02, (0x6001, 1, 8))]
    found = find_combination(twice, offered, wants((0x6000, 2, 16), (0x6001, 1, 8)))
    assert indices(found) == [0x1A00, 0x1A01, 0x1A02]


def test_the_order_of_indices_is_kept_where_the_device_has_it() -> None:
    """Beckhoff's EL6731 wants PDOs in the order of their indices."""
    offered = [pdo(0x1A00, (1, 0, 8)), pdo(0x1A01, (2, 0, 8)), pdo(0x1A02, (3, 0, 8))]
    ordered = find_combination([offered[0], offered[2]], offered, wants((2, 0, 8)))
    assert indices(ordered) == [0x1A00, 0x1A01, 0x1A02]
    other = find_combination([offered[2], offered[0]], offered, wants((2, 0, 8)))
    assert indices(other) == [0x1A02, 0x1A00, 0x1A01]


def test_a_device_with_hundreds_of_pdos_is_answered() -> None:
    """A gateway such as the EL6731: no combination is right, and the search ends."""
    offered = [pdo(0x1A00 + k, (0x2000 + k % 20, 0, 8), (0x3000 + k, 0, 8)) for k in range(250)]
    wanted = wants(*((0x2000 + k, 0, 8) for k in range(20)), (0x3000, 0, 8), (0x3014, 0, 8))
    assert find_combination([], offered, wanted) is None


SMALL = st.builds(
    lambda index, objects, mandatory: pdo(
        index, *((k, 0, 8) for k in objects), mandatory=mandatory
    ),
    st.integers(0x1A00, 0x1A06),
    st.sets(st.integers(1, 5), min_size=1),
    st.booleans(),
)
DISTINCT = st.lists(SMALL, max_size=6, unique_by=lambda each: each.index)


@given(DISTINCT, st.data())
def test_a_combination_keeps_all_rules(offered: list[Pdo], data: st.DataObject) -> None:
    assigned = data.draw(st.lists(st.sampled_from(offered), unique=True)) if offered else []
    wanted = wants(*((k, 0, 8) for k in data.draw(st.sets(st.integers(1, 5)))))
    found = find_combination(assigned, offered, wanted)
    if found is None:
        assert wanted
        assert explain_failure(assigned, offered, wanted)
        return
    assert all(any_carries(found.pdos, each) for each in wanted)
    assert {p.index for p in assigned if p.mandatory} <= {p.index for p in found.pdos}
    for new in found.added:
        assert not any(conflict(new, other) for other in found.pdos if other is not new)
    assert set(found.pdos) == {*assigned, *found.added} - set(found.removed)


# -- real descriptions, read in place ------------------------------------------------------------


def described(image: bytes) -> DeviceDescription:
    information = bytes((0x11, 0, 2, 0, 3, 4, 8, 0x0F, 0, 0))
    return describe(
        0, station_address=0x1001, alias=0, dl_status=0, information=information, image=image
    )


@pytest.mark.parametrize("name", ["beckhoff_el2004", "beckhoff_el2889", "pollen_Orbita2d"])
def test_real_images_carry_what_they_have_as_assigned(shared_data: Path, name: str) -> None:
    device = described((shared_data / "sii" / f"{name}.bin").read_bytes())
    for direction in Direction:
        for each in device.assignments(direction):
            wanted = wants(
                *((e.index, e.subindex, e.bit_length) for p in each.pdos for e in p.entries)
            )
            found = find_combination(each.pdos, device.pdos(direction), wanted)
            assert found == Combination(each.pdos)
            assert (
                find_combination(each.pdos, device.pdos(direction), wants((0x5FFF, 1, 8))) is None
            )


def number(text: str) -> int:
    return int(text.lower().replace("#x", "0x").replace("0x0x", "0x"), 0)


def esi_pdos(path: Path, tag: str) -> list[Pdo]:
    """All PDOs of a file, numbered anew: those of alternative modules share an index."""
    found = []
    for rank, element in enumerate(ElementTree.parse(path).iter(tag)):
        entries = []
        for entry in element.iter("Entry"):
            place = [entry.findtext(name, "0").strip() for name in ("Index", "SubIndex", "BitLen")]
            entries.append(tuple(number(text) for text in place))
        found.append(pdo(0x1600 + rank, *entries))
    return found


def test_alternative_modules_of_a_real_esi_are_exchanged(shared_data: Path) -> None:
    """HPMicro's CiA 402 sample has a module each for CSP with CSV, for CSP and for CSV."""
    offered = esi_pdos(shared_data / "esi" / "hpm_ECAT_CIA402.xml", "RxPdo")
    assert len(offered) == 3
    with_velocity = [p for p in offered if any_carries([p], wants(VELOCITY)[0])]
    without = next(p for p in offered if p not in with_velocity)
    found = find_combination([without], offered, wants(CONTROL, VELOCITY))
    assert found is not None
    assert found.removed == (without,)
    assert found.pdos == (with_velocity[0],)
