"""Facts of a device that its object dictionary gives, for a comparison with its description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from catenary.model.device import Identity

MappedObject: TypeAlias = tuple[int, int, int]  # index, subindex, number of bits; index 0: a gap


@dataclass(frozen=True, slots=True)
class EntryFacts:
    """Description of a dictionary entry by the device (SDO information)."""

    index: int
    subindex: int
    data_type: int
    bit_length: int
    readable: bool
    writable: bool


@dataclass(frozen=True, slots=True)
class CoeFacts:
    """Objects of a device, as read by SDO. None marks what the device refused or was not asked."""

    identity: Identity | None = None  # 0x1018; serial number 0 if refused
    device_type: int | None = None  # 0x1000
    # PDOs by SyncManager (0x1C10 + SyncManager); None if refused
    assignments: Mapping[int, tuple[int, ...] | None] = field(default_factory=dict)
    # entries by PDO; None if refused
    mappings: Mapping[int, tuple[MappedObject, ...] | None] = field(default_factory=dict)
    sdo_information: bool | None = None  # True if the device describes its objects
    complete_access: bool | None = None  # True if the device allows complete access
    pdo_assign: bool | None = None  # True if an assignment object is writable
    # all objects that the device lists; None if not read
    indices: frozenset[int] | None = None
    # entries by object; None for an object that the device does not describe
    objects: Mapping[int, tuple[EntryFacts, ...] | None] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # what could not be read, and why
