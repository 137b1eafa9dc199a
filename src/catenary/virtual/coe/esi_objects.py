"""Facts about the objects of a device from the dictionary of its ESI."""

from __future__ import annotations

from catenary.esi.device import EsiDevice
from catenary.esi.dictionary import EsiDictionary, EsiObjectEntry
from catenary.esi.sii_process_data import type_number
from catenary.virtual.coe.dictionary import MAP_RX, MAP_TX, READ_ANY, WRITE_ANY
from catenary.virtual.coe.object_facts import EntryFacts, ObjectFacts

ACCESS = {"ro": READ_ANY, "wo": WRITE_ANY, "rw": READ_ANY | WRITE_ANY}


def esi_objects(device: EsiDevice) -> tuple[ObjectFacts, ...]:
    """Return the objects of the dictionary, with their default values."""
    dictionary = device.dictionary
    if dictionary is None:
        return ()
    return tuple(
        ObjectFacts(
            each.index, each.name, tuple(_entry(entry, dictionary) for entry in each.entries)
        )
        for each in dictionary.objects.values()
    )


def _entry(entry: EsiObjectEntry, dictionary: EsiDictionary) -> EntryFacts:
    return EntryFacts(
        entry.subindex,
        entry.name,
        type_number(entry.type, dictionary),
        entry.bit_length,
        ACCESS.get(entry.access, READ_ANY) | _mappable(entry.pdo_mapping),
        entry.default,
    )


def _mappable(mapping: str) -> int:
    return (MAP_RX if "R" in mapping.upper() else 0) | (MAP_TX if "T" in mapping.upper() else 0)
