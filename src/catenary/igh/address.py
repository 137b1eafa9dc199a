"""Addresses of devices for the kernel master: an alias, and the number of devices after it.

An address with an alias remains valid if the device is moved on the line. A device that has no
alias at or before its position is addressed by its position.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Address(NamedTuple):
    """The first two arguments of `ecrt_master_slave_config`.

    `steps` counts from the device with `alias`, or from the first device if `alias` is 0.
    """

    alias: int
    steps: int


def addresses(aliases: Sequence[int]) -> list[Address]:
    """Return the addresses of all devices, by position.

    A duplicate alias is not used, because the master would take the first device that has it.
    """
    found: list[Address] = []
    head: int | None = None
    for position, alias in enumerate(aliases):
        if alias:
            head = position if aliases.count(alias) == 1 else None
        found.append(
            Address(0, position) if head is None else Address(aliases[head], position - head)
        )
    return found


def place(address: Address, aliases: Sequence[int]) -> int | None:
    """Return the current position of a device; None if it is not on the segment.

    Args:
        address: The address of the device.
        aliases: The current aliases of all devices, by position.
    """
    first = 0
    if address.alias:
        if address.alias not in aliases:
            return None
        first = aliases.index(address.alias)
    there = first + address.steps
    return there if there < len(aliases) else None
