"""Verdicts on devices that differ from the file, and their likely causes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from catenary.bus import SubDevice
from catenary.machine.comparison import Comparison, compare
from catenary.machine.schema import DeviceTable, IdentityTable
from catenary.model.device import Identity

A, B, C, D = 0xA, 0xB, 0xC, 0xD  # product codes


def subs(*products: int, aliases: tuple[int, ...] = ()) -> list[SubDevice]:
    """Return devices of these products, in the order of the cable."""
    padded = (*aliases, *(0,) * len(products))
    return [
        cast(
            SubDevice,
            SimpleNamespace(
                position=position,
                alias=padded[position],
                name=f"product {product:X}",
                identity=Identity(1, product, 1, 7),
            ),
        )
        for position, product in enumerate(products)
    ]


def at(position: int, product: int) -> DeviceTable:
    """Return a device of the file with a position."""
    identity = IdentityTable(vendor=1, product=product)
    return DeviceTable(name=f"{position}-{product:X}", position=position, identity=identity)


def verdicts(found: tuple[Comparison, ...]) -> list[str]:
    return [each.verdict for each in found]


def test_the_same_devices() -> None:
    found = compare([at(0, A), at(1, B)], subs(A, B))
    assert verdicts(found) == ["same", "same"]
    assert [each.fault for each in found] == ["", ""]


def test_a_device_that_the_file_does_not_name_comes_last() -> None:
    found = compare([at(1, B)], subs(A, B))
    assert verdicts(found) == ["same", "unknown"]
    assert "position 0 (product A) is not in the file" in found[1].fault


def test_two_devices_that_are_swapped() -> None:
    found = compare([at(0, A), at(1, B), at(2, C)], subs(A, C, B))
    assert verdicts(found) == ["same", "different", "different"]
    assert 'identity of "2-C"; check' in found[1].cause


def test_one_more_device_on_the_cable() -> None:
    found = compare([at(0, A), at(1, B), at(2, C)], subs(A, D, B, C))
    assert verdicts(found) == ["same", "different", "different", "unknown"]
    assert found[1].cause.startswith("the cable has 1 more device before it")


def test_one_fewer_device_on_the_cable() -> None:
    found = compare([at(0, A), at(1, B), at(2, C), at(3, D)], subs(A, C, D))
    assert verdicts(found) == ["same", "different", "different", "missing"]
    assert found[1].cause.startswith("the cable has 1 fewer device before it")


def test_a_device_of_an_unexpected_kind() -> None:
    found = compare([at(0, A), at(1, B)], subs(A, D))
    assert "check the order of the devices" in found[1].cause


@pytest.mark.parametrize(
    ("more", "text"),
    [({"revision": 2}, "another revision"), ({"serial": 8}, "another serial")],
)
def test_the_same_product_with_another_number(more: dict[str, int], text: str) -> None:
    device = DeviceTable(name="j1", position=0, identity=IdentityTable(vendor=1, product=A, **more))
    [found] = compare([device], subs(A))
    assert found.verdict == "different"
    assert f"the same product with {text}" in found.cause


def test_an_alias_of_another_device() -> None:
    device = DeviceTable(name="j1", alias=5, identity=IdentityTable(vendor=1, product=B))
    [found, _] = compare([device], subs(A, B, aliases=(5,)))
    assert found.verdict == "different"
    assert "alias 5 was written to another device" in found.cause


def test_an_alias_that_no_device_has() -> None:
    device = DeviceTable(name="j1", alias=5, identity=IdentityTable(vendor=1, product=B))
    [found, *_] = compare([device], subs(A, B, aliases=(0, 6)))
    assert found.verdict == "missing"
    assert "position 1 (product B) has this identity and alias 6" in found.cause
    [found, *_] = compare([device], subs(A))
    assert "no unassigned device has this identity; check cables and power" in found.cause


def test_an_optional_device_is_absent() -> None:
    identity = IdentityTable(vendor=1, product=B)
    device = DeviceTable(name="tool", alias=5, identity=identity, required=False)
    assert verdicts(compare([device], [])) == ["absent"]
