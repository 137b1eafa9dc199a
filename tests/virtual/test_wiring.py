"""Cables: the order of a tree, and errors for invalid trees."""

from __future__ import annotations

import pytest

from catenary.virtual.wiring import FIRST, SECOND, Wiring

LINE, JUNCTION = (0, 1), (0, 1, 2, 3)


def test_line_is_the_default() -> None:
    wiring = Wiring([LINE] * 3, {}, ring=False)
    assert wiring.cables == (((FIRST, 0), (0, 0)), ((0, 1), (1, 0)), ((1, 1), (2, 0)))
    assert wiring.between("main", 0) == 0
    assert wiring.between(2, 1) == 2


def test_ring_returns_from_the_last_device() -> None:
    wiring = Wiring([LINE, JUNCTION, LINE, LINE], {2: (1, 3), 3: (1, 1)}, ring=True)
    assert wiring.cables[-1] == ((3, 1), (SECOND, 0))
    assert wiring.between(3, "main") == 4


def test_branches_follow_the_port_order_3_1_2() -> None:
    behind = {1: (0, 3), 2: (0, 1), 4: (0, 2)}
    wiring = Wiring([JUNCTION] + [LINE] * 4, behind, ring=False)
    assert [cable.up for cable in wiring.cables[1:]] == [(0, 3), (0, 1), (2, 1), (0, 2)]
    assert wiring.at_port(0, 2)
    assert not wiring.at_port(4, 1)


@pytest.mark.parametrize(
    ("behind", "says"),
    [
        ({1: (0, 1), 2: (0, 3)}, r"order \[0, 2, 1\]"),
        ({2: (0, 1)}, "port 1 of device 0 is already connected to device 1"),
        ({2: (1, 3)}, "device 1 has no port 3"),
        ({2: (0, 0)}, "device 0 has no port 0"),
        ({1: (2, 1)}, "behind one of the devices 0 to 0, not 2"),
        ({5: (0, 1)}, "device 5 cannot be placed"),
        ({0: (1, 1)}, "device 0 cannot be placed"),
    ],
)
def test_invalid_tree_is_refused_with_the_reason(
    behind: dict[int, tuple[int, int]], says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        Wiring([JUNCTION, LINE, LINE], behind, ring=False)


def test_ring_needs_a_port_for_the_returning_cable() -> None:
    with pytest.raises(ValueError, match="ring"):
        Wiring([], {}, ring=True)
    with pytest.raises(ValueError, match="no port 1"):
        Wiring([LINE, (0,)], {}, ring=True)


def test_unconnected_devices_are_not_neighbours() -> None:
    with pytest.raises(
        ValueError, match=r"0 and 2 are not neighbours; the cables are main-0, 0-1, 1-2"
    ):
        Wiring([LINE] * 3, {}, ring=False).between(0, 2)
