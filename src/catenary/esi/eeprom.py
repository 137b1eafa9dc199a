"""EEPROM of an ESI device (`Eeprom`; ETG.2000, EepromType)."""

from __future__ import annotations

from catenary.esi.device import EsiEeprom, EsiEepromCategory
from catenary.esi.findings import Findings
from catenary.esi.xml import Element

NUMBERS = {"DataUINT": 2, "DataUDINT": 4}  # sizes of categories with one number [bytes]


def read_eeprom(device: Element, findings: Findings) -> EsiEeprom | None:
    """Return the EEPROM of a device; None if the file does not describe it.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    element = device.find("Eeprom")
    if element is None:
        return None
    categories = (_category(child, findings) for child in element.all("Category"))
    return EsiEeprom(
        byte_size=findings.integer(element.find("ByteSize")),
        config_data=findings.data(element.find("ConfigData")) or b"",
        bootstrap=findings.data(element.find("BootStrap")) or b"",
        data=findings.data(element.find("Data")) or b"",
        assign_to_pdi=findings.flag(element, "AssignToPdi"),
        categories=tuple(category for category in categories if category is not None),
    )


def _category(element: Element, findings: Findings) -> EsiEepromCategory | None:
    """Return a category. `DataString` becomes text, the other forms little-endian bytes."""
    number = findings.required(element, "CatNo", bits=16)
    if number is None:
        return None
    data = findings.data(element.find("Data")) or b""
    text = element.find("DataString")
    if text is not None:
        data += text.text.strip().encode("utf-8", "replace")
    for tag, size in NUMBERS.items():
        for child in element.all(tag):
            data += findings.integer(child, bits=8 * size).to_bytes(size, "little")
    return EsiEepromCategory(number, data)
