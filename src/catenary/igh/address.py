"""How a device is named to the master: by the alias of a device and the steps behind it, so that it
is followed where it is plugged in; by its position where nobody in front of it has an alias."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Address(NamedTuple):
    """The first two arguments of `ecrt_master_slave_config`. `alias` 0: `steps` from the start."""

    alias: int
    steps: int


def addresses(aliases: Sequence[int]) -> list[Address]:
    """By position. An alias that two have names neither: the master would take the first."""
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
    """Where that device is now; None: nowhere."""
    first = 0
    if address.alias:
        if address.alias not in aliases:
            return None
        first = aliases.index(address.alias)
    there = first + address.steps
    return there if there < len(aliases) else None
