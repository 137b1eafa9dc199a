"""Objects of an ESI dictionary as descriptions of the model: data types, units, enumerations."""

from __future__ import annotations

from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.esi.units import unit_text
from catenary.model.device import ObjectInformation
from catenary.types import by_name

DERIVATIONS_MAX = 8  # in a chain of derived types; a longer chain is circular


def documented_objects(dictionary: EsiDictionary | None) -> tuple[ObjectInformation, ...]:
    """Return all entries of a dictionary, in the order of the file; empty without a dictionary."""
    if dictionary is None:
        return ()
    return tuple(
        _information(dictionary, known, entry)
        for known in dictionary.objects.values()
        for entry in known.entries
    )


def data_type_index(name: str, bit_length: int, dictionary: EsiDictionary | None = None) -> int:
    """Return the index of a data type (ETG.1000.6 table 64), or of the base of a derived type.

    The result is 0 if the type is not a base data type, or if its length differs.

    Args:
        name: Name in the ESI, such as "UDINT", "STRING(20)", or a type of the dictionary.
        bit_length: Length of the value [bits].
        dictionary: Dictionary with the derived types.
    """
    types = {} if dictionary is None else dictionary.types
    for _ in range(DERIVATIONS_MAX):
        try:
            kind = by_name(name.split("(")[0])
        except ValueError:
            derived = types.get(name)
            if derived is None or derived.arrays or not derived.base or derived.base == name:
                return 0
            name = derived.base
            continue
        return kind.index if kind.bit_length in (0, bit_length) else 0
    return 0


def enumeration_of(
    entry: EsiObjectEntry, dictionary: EsiDictionary | None
) -> tuple[tuple[int, str], ...]:
    """Return the values of an entry that have texts, in ascending order.

    Args:
        entry: Entry of the dictionary.
        dictionary: Dictionary with the enumeration types.
    """
    texts = entry.enumeration
    if not texts and dictionary is not None and entry.type in dictionary.types:
        texts = dictionary.types[entry.type].enumeration
    return tuple(sorted(texts.items()))


def _information(
    dictionary: EsiDictionary, known: EsiObject, entry: EsiObjectEntry
) -> ObjectInformation:
    return ObjectInformation(
        entry.index,
        entry.subindex,
        entry.bit_length,
        data_type_index(entry.type, entry.bit_length, dictionary),
        "R" in entry.pdo_mapping,
        "T" in entry.pdo_mapping,
        entry.name or known.name,
        readable=entry.access != "wo",
        unit=unit_text(entry.unit),
        enumeration=enumeration_of(entry, dictionary),
    )
