"""Devices addressed by the alias of a preceding device."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.igh import Master
from catenary.igh.address import Address, addresses, place
from catenary.types import UDINT
from tests.igh.double import Double


@pytest.fixture
def main(double: Double) -> Iterator[cat.MainDevice]:
    """Yield three drives, the second with alias 7."""
    double.reset(3)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        yield main


def test_a_unique_alias_is_used_as_address() -> None:
    assert addresses([0, 7, 0, 9]) == [(0, 0), (7, 0), (7, 1), (9, 0)]
    assert addresses([7, 0, 7, 0]) == [(0, 0), (0, 1), (0, 2), (0, 3)]
    assert addresses([]) == []


def test_the_current_position_of_a_device() -> None:
    assert place(Address(7, 1), [7, 0, 0]) == 1
    assert place(Address(7, 2), [0, 7, 0]) is None
    assert place(Address(9, 0), [0, 7, 0]) is None
    assert place(Address(0, 1), [7, 0]) == 1


def test_the_master_gets_aliases(main: cat.MainDevice, double: Double) -> None:
    with cat.Loop(cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)):
        pass
    told = [call for call in double.calls() if call.startswith("slave_config ")]
    assert told == [f"slave_config {where} aa 402" for where in ("0 0", "7 0", "7 1")]


def test_a_group_is_the_same_as_on_our_own_master(main: cat.MainDevice) -> None:
    assert main.subs.group(7) == (main.subs[1], main.subs[2])


def test_a_moved_device_is_found_by_its_alias(main: cat.MainDevice, double: Double) -> None:
    """The two drives of the tool and the drive before them exchange places."""
    double.set(1, 0x6076, 0, 5000)
    tool = cat.Drives([main.subs.group(7)[0]], counts_per_turn=1000, velocity_limit=100.0)
    with cat.Loop(tool, stop=cat.StopPolicy(raise_faults=False)) as loop:
        double.swap(0, 1)
        for _ in range(50):
            next(loop)
        tool.target.position[:] = tool.actual.position + 0.1
        for _ in range(10):
            next(loop)
        assert double.value(0, 0x607A, 0) != 0
        double.forget()
        written = main.subs[1].sdo.request_write(0x6076, 0, 6000, type=UDINT)
        for _ in range(10):
            next(loop)
        written.result()
        assert any(call.startswith("sdo_download 0 6076:00") for call in double.calls())
    assert double.value(0, 0x6076, 0) == 6000
