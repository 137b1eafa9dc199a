"""Objects of an ESI dictionary in the form of SDO information, for devices without this service."""

from __future__ import annotations

from typing import TYPE_CHECKING

from catenary.procedure.sdo_information import DescribedObject
from catenary.wire.sdo_information import (
    Access,
    EntryDescription,
    ListType,
    ObjectCode,
    ObjectDescription,
    ValueInfo,
)

if TYPE_CHECKING:  # a scan without ESI files does not need them
    from catenary.esi.device import EsiDevice
    from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry

READ = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
WRITE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP
_ACCESS = {"ro": READ, "rw": READ | WRITE, "wo": WRITE}
_MAPPABLE = {ListType.RXPDO_MAPPABLE: "R", ListType.TXPDO_MAPPABLE: "T"}


def list_esi_objects(esi: EsiDevice, kind: ListType) -> tuple[ObjectDescription, ...]:
    """Return the descriptions of all objects of a kind, by index.

    Args:
        esi: ESI of the device.
        kind: All objects, or those that can be mapped. The result is empty for other kinds.
    """
    objects = [] if esi.dictionary is None else list(esi.dictionary.objects.values())
    if kind is not ListType.ALL:
        letter = _MAPPABLE.get(kind, "?")
        objects = [each for each in objects if any(letter in e.pdo_mapping for e in each.entries)]
    return tuple(_description(each) for each in sorted(objects, key=lambda each: each.index))


def describe_esi_object(esi: EsiDevice, index: int) -> DescribedObject | None:
    """Return the description of one object and its entries; None if the ESI does not have it.

    Args:
        esi: ESI of the device.
        index: Index of the object.
    """
    found = None if esi.dictionary is None else esi.dictionary.objects.get(index)
    if esi.dictionary is None or found is None:
        return None
    entries = tuple(_entry(each, esi.dictionary) for each in found.entries)
    return DescribedObject(_description(found), entries, (f"described by {found.source}",))


def _description(known: EsiObject) -> ObjectDescription:
    subindices = [entry.subindex for entry in known.entries] or [0]
    code = ObjectCode.VAR if subindices == [0] else ObjectCode.RECORD
    return ObjectDescription(known.index, 0, max(subindices), code, known.name)


def _entry(known: EsiObjectEntry, dictionary: EsiDictionary) -> EntryDescription:
    from catenary.esi.object_descriptions import data_type_index

    access = _ACCESS.get(known.access, READ)
    if "R" in known.pdo_mapping:
        access |= Access.RXPDO_MAPPABLE
    if "T" in known.pdo_mapping:
        access |= Access.TXPDO_MAPPABLE
    return EntryDescription(
        known.index,
        known.subindex,
        ValueInfo(0),
        data_type_index(known.type, known.bit_length, dictionary),
        known.bit_length,
        access,
        known.name.encode("latin-1", "replace"),
    )
