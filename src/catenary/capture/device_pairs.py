"""Pairs of devices in two captures: by vendor, product and serial number, then by order."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar

from catenary.capture.difference import DevicePair
from catenary.capture.events import Device

T = TypeVar("T", bound=Hashable)


def pair_devices(a: Iterable[Device], b: Iterable[Device]) -> tuple[DevicePair, ...]:
    """Return the pairs in the order of A, then the devices that only B has.

    Devices with different known identities are never paired. A device whose identity the capture
    does not show is paired by its place among the remaining devices.

    Args:
        a: Devices of A.
        b: Devices of B.
    """
    left, right = sorted(a, key=_place), sorted(b, key=_place)
    partner: dict[int, Device] = {}
    for key in (_serial_key, _product_key, _position_key):
        _match(left, right, partner, key)
    _match(left, [each for each in right if each.vendor is None], partner, _any_key)
    _match([each for each in left if each.vendor is None], right, partner, _any_key)
    taken = {each.number for each in partner.values()}
    pairs = [DevicePair(each, partner.get(each.number)) for each in left]
    return (*pairs, *(DevicePair(None, each) for each in right if each.number not in taken))


def out_of_place(order: Sequence[int]) -> frozenset[int]:
    """Return the places with another rank than in the ascending order.

    Args:
        order: Different numbers, in the order of A, with their places in B.
    """
    ascending = sorted(order)
    return frozenset(i for i, value in enumerate(order) if ascending[i] != value)


def _match(
    left: Sequence[Device],
    right: Sequence[Device],
    partner: dict[int, Device],
    key: Callable[[Device], Hashable],
) -> None:
    """Pair the devices with equal keys in order, unless one of them has a partner."""
    taken = {each.number for each in partner.values()}
    free: dict[Hashable, list[Device]] = defaultdict(list)
    for device in reversed(right):
        if device.number not in taken and key(device) is not None:
            free[key(device)].append(device)
    for device in left:
        if device.number in partner or key(device) is None:
            continue
        candidates = free[key(device)]
        if candidates and _may_be_same(device, candidates[-1]):
            partner[device.number] = candidates.pop()


def _may_be_same(a: Device, b: Device) -> bool:
    known = a.vendor is not None and b.vendor is not None
    return not known or (a.vendor, a.product) == (b.vendor, b.product)


def _place(device: Device) -> tuple[bool, int, int]:
    return device.position is None, device.position or 0, device.number


def _serial_key(device: Device) -> Hashable:
    return (device.vendor, device.product, device.serial) if device.serial else None


def _product_key(device: Device) -> Hashable:
    return None if device.vendor is None else (device.vendor, device.product)


def _position_key(device: Device) -> Hashable:
    return device.position


def _any_key(device: Device) -> Hashable:
    return True
