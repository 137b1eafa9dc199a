"""Search for registers by name, such as `AL_STATUS`, "al status", "fmmu0" or "SyncManager 2"."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache
from typing import Any, TypeAlias

from catenary.wire import register
from catenary.wire.register import Register

AnyRegister: TypeAlias = Register[Any]

_INDEXED = (
    (register.rx_error_counter, register.PORT_COUNT),
    (register.forwarded_rx_error_counter, register.PORT_COUNT),
    (register.lost_link_counter, register.PORT_COUNT),
    (register.phy_port_status, register.PORT_COUNT),
    (register.receive_time, register.PORT_COUNT),
    (register.fmmu, register.FMMU_COUNT),
    (register.sync_manager, register.SYNC_MANAGER_COUNT),
    (register.sync_manager_status, register.SYNC_MANAGER_COUNT),
    (register.sync_manager_activation, register.SYNC_MANAGER_COUNT),
    (register.sync_manager_pdi_control, register.SYNC_MANAGER_COUNT),
)


def names() -> tuple[str, ...]:
    """Return the names of all registers, ordered by address."""
    known = sorted(_by_key().values(), key=lambda each: (each.address, each.size))
    return tuple(dict.fromkeys(each.name for each in known))


def by_name(name: str) -> AnyRegister:
    """Return the register with this name. Case, spaces and underscores are ignored.

    Raises:
        ValueError: No register has this name. The message lists similar names.
    """
    known = _by_key()
    found = known.get(_key(name))
    if found is not None:
        return found
    guesses = ", ".join(near(name))
    raise ValueError(
        f"unknown register {name!r}" + (f"; similar names: {guesses}" if guesses else "")
    )


def near(name: str) -> tuple[str, ...]:
    """Return the register names that are similar to a name, the most similar one first."""
    known = _by_key()
    found = get_close_matches(_key(name), known, n=3, cutoff=0.6)
    return tuple(dict.fromkeys(known[key].name for key in found))


def at_address(address: int, size: int | None = None) -> AnyRegister | None:
    """Return the register at an address; None if no register matches.

    Args:
        address: Address of the first byte.
        size: Size [bytes]; None for any size. Several registers may then match: numbers take
            precedence over blocks, then smaller registers over larger ones.
    """
    found = [
        each for each in _by_key().values() if each.address == address and size in (None, each.size)
    ]
    return min(found, key=lambda each: (each.format.endswith("s"), each.size), default=None)


@cache
def _by_key() -> dict[str, AnyRegister]:
    found: dict[str, AnyRegister] = {}
    for constant, each in _all():
        found.setdefault(_key(each.name), each)
        if constant:
            found[_key(constant)] = each
    return found


def _all() -> Iterator[tuple[str, AnyRegister]]:
    for constant, value in vars(register).items():
        if isinstance(value, Register):
            yield constant, value
    for make, count in _INDEXED:
        for number in range(count):
            yield "", make(number)


def _key(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())
