"""EEPROM images as JSON."""

from __future__ import annotations

from catenary.cli.plain import plain
from catenary.cli.sii_text import KNOWN, tolerant
from catenary.errors import DecodeError
from catenary.wire.sii import Sii
from catenary.wire.sii_categories import ClockMode, Pdo
from catenary.wire.sii_check import objections


def as_values(image: bytes) -> dict[str, object]:
    """Return the fields of an image, and its faults. Text numbers are replaced by the texts."""
    found: dict[str, object] = {
        "size": len(image),
        "faults": [{"text": each.text, "hint": each.hint} for each in objections(image)],
    }
    try:
        return found | _fields(tolerant(image))
    except DecodeError as error:
        return found | {"invalid": error.message}


def _fields(sii: Sii) -> dict[str, object]:
    return {
        "header": plain(sii.header),
        "general": None if sii.general is None else _named(sii, sii.general, GENERAL_TEXTS),
        "strings": plain(sii.strings),
        "fmmus": plain(sii.fmmus),
        "sync_managers": plain(sii.sync_managers),
        "receive_pdos": [_pdo(sii, each) for each in sii.receive_pdos],
        "transmit_pdos": [_pdo(sii, each) for each in sii.transmit_pdos],
        "clock_modes": [_mode(sii, each) for each in sii.clock_modes],
        "other_categories": [plain(each) for each in sii.categories if each.type not in KNOWN],
    }


GENERAL_TEXTS = ("name", "order", "group", "image")


def _named(sii: Sii, value: object, texts: tuple[str, ...]) -> dict[str, object]:
    """Return the fields of a value, with the text of each number in `texts`."""
    found = plain(value)
    assert isinstance(found, dict)
    return found | {name: sii.string(getattr(value, name)) for name in texts}


def _pdo(sii: Sii, pdo: Pdo) -> dict[str, object]:
    entries = [_named(sii, each, ("name",)) for each in pdo.entries]
    return _named(sii, pdo, ("name",)) | {"entries": entries}


def _mode(sii: Sii, mode: ClockMode) -> dict[str, object]:
    return _named(sii, mode, ("name", "description"))
