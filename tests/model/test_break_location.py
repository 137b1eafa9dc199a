"""Location of a break from the devices that do not answer."""

from __future__ import annotations

import pytest

from catenary.model.break_location import behind, judge_silence
from catenary.model.finding import Names
from catenary.model.topology import Topology, make_topology
from tests.model.tables import END, LINE, STAR, line

TREE = make_topology([LINE, STAR, LINE, END, END, END])  # 1: port 3 → 2 ─ 3, port 1 → 4, port 2 → 5


def names(topology: Topology) -> Names:
    return Names(("",) * len(topology))


def test_no_silent_device_gives_no_finding() -> None:
    assert judge_silence(TREE, names(TREE), []) == ()


def test_devices_behind_a_device() -> None:
    assert behind(TREE, 1) == (2, 3, 4, 5)
    assert behind(TREE, 2) == (3,)
    assert behind(TREE, 5) == ()


def test_a_cut_line_names_the_cable_before_the_first_silent_device() -> None:
    topology = make_topology(line(6))
    [found] = judge_silence(topology, names(topology), [3, 4, 5])
    assert found.where == (
        "the cable between device 2 port 1 and device 3 port 0, or the power of device 3"
    )
    assert found.evidence == "device 3 and the 2 behind it do not answer"
    assert found.devices == (3, 4, 5)


def test_a_cut_branch_does_not_affect_others() -> None:
    [found] = judge_silence(TREE, names(TREE), [2, 3])
    assert found.devices == (2, 3)
    assert "device 1 port 3 and device 2 port 0" in found.where


def test_two_cut_branches_are_two_findings() -> None:
    found = judge_silence(TREE, names(TREE), [2, 3, 5])
    assert [each.devices for each in found] == [(2, 3), (5,)]


def test_a_device_that_forwards_has_lost_its_address() -> None:
    topology = make_topology(line(4))
    [found] = judge_silence(topology, names(topology), [1])
    assert found.evidence == (
        "it does not answer, but the devices behind it do: it has lost its station address"
    )


def test_a_reset_device_before_a_cut() -> None:
    topology = make_topology(line(5))
    found = judge_silence(topology, names(topology), [1, 3, 4])
    assert [each.devices for each in found] == [(1,), (3, 4)]


@pytest.mark.parametrize("silent", [range(6), [0, 1, 2, 3, 4, 5]])
def test_silence_of_all_devices_is_the_first_cable(silent: range | list[int]) -> None:
    [found] = judge_silence(TREE, names(TREE), silent)
    assert "between the MainDevice and device 0 port 0" in found.where
