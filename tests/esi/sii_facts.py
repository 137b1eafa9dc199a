"""Fields of an SII image by name, for comparisons. String numbers are replaced by the strings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from catenary.wire.sii import Sii
from catenary.wire.sii_categories import General, Pdo

DERIVED = {"checksum", "reserved"}
TEXTS = ("order", "name", "group", "image")


def facts(sii: Sii) -> dict[str, object]:
    """Return the fields of an image by name."""
    return dict(_facts(sii))


def differences(vendor: Sii, built: Sii) -> dict[str, tuple[object, object]]:
    """Return the fields that differ: (vendor's value, our value); None if a field is missing."""
    one, other = facts(vendor), facts(built)
    names = dict.fromkeys([*one, *other])
    return {
        name: (one.get(name), other.get(name)) for name in names if one.get(name) != other.get(name)
    }


def _facts(sii: Sii) -> Iterator[tuple[str, object]]:
    yield "categories", tuple(each.type for each in sii.categories)
    for field in fields(sii.header):
        if field.name not in DERIVED:
            yield f"header {field.name}", getattr(sii.header, field.name)
    yield from _general(sii, sii.general or General())
    for number, use in enumerate(sii.fmmus):
        yield f"FMMU {number}", use
    for number, manager in enumerate(sii.sync_managers):
        for field in fields(manager):
            yield f"SyncManager {number} {field.name}", getattr(manager, field.name)
    for kind, pdos in (("RxPDO", sii.receive_pdos), ("TxPDO", sii.transmit_pdos)):
        for pdo in pdos:
            yield from _pdo(sii, f"{kind} 0x{pdo.index:04X}", pdo)
    for number, mode in enumerate(sii.clock_modes):
        yield f"OpMode {number} name", sii.string(mode.name)
        yield f"OpMode {number} description", sii.string(mode.description)
        for field in fields(mode):
            if field.name not in ("name", "description"):
                yield f"OpMode {number} {field.name}", getattr(mode, field.name)


def _general(sii: Sii, general: General) -> Iterator[tuple[str, object]]:
    for field in fields(general):
        if field.name in TEXTS:
            yield f"general {field.name}", sii.string(getattr(general, field.name))
        elif field.name not in DERIVED:
            yield f"general {field.name}", getattr(general, field.name)
    yield "general byte 14", sii.string(general.reserved[1])


def _pdo(sii: Sii, name: str, pdo: Pdo) -> Iterator[tuple[str, object]]:
    yield f"{name} name", sii.string(pdo.name)
    yield f"{name} sync_manager", pdo.sync_manager
    yield f"{name} flags", pdo.flags
    for number, entry in enumerate(pdo.entries):
        yield (
            f"{name} entry {number}",
            (entry.index, entry.subindex, entry.bit_length, sii.string(entry.name)),
        )
        yield f"{name} entry {number} type", entry.data_type
