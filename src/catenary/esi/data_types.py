"""Data types of an ESI dictionary (`DataTypes`; ETG.2000, DataTypeType)."""

from __future__ import annotations

from collections.abc import Mapping

from catenary.esi.dictionary import EsiArray, EsiDataType, EsiSubItem
from catenary.esi.findings import Findings, text_of
from catenary.esi.values import plain_text, shown
from catenary.esi.xml import Element

ACCESS = {"ro": "ro", "rw": "rw", "wo": "wo", "r": "ro", "w": "wo", "const": "ro"}
ELEMENTS_MAX = 0xFF  # subindices of an object
BASES_MAX = 8  # derived types in a chain


def read_data_types(dictionary: Element, findings: Findings) -> dict[str, EsiDataType]:
    """Return the data types of a dictionary by name. The first of equal names counts.

    Args:
        dictionary: The dictionary.
        findings: The warnings of the reader.
    """
    parent = dictionary.find("DataTypes")
    types: dict[str, EsiDataType] = {}
    for element in parent.all("DataType") if parent is not None else ():
        found = _data_type(element, findings)
        if not found.name:
            findings.warn(element, "DataType without a name is ignored")
        else:
            types.setdefault(found.name, found)
    return types


def enumeration_of(name: str, types: Mapping[str, EsiDataType]) -> Mapping[int, str]:
    """Return the texts of an enumeration type, or of its base types; empty for other types.

    Args:
        name: The name of the type.
        types: The data types of the dictionary.
    """
    for _ in range(BASES_MAX):
        found = types.get(name)
        if found is None:
            break
        if found.enumeration:
            return found.enumeration
        name = found.base
    return {}


def base_of(name: str, types: Mapping[str, EsiDataType]) -> str:
    """Return the name of the base type at the end of a chain of derived types.

    Args:
        name: The name of the type.
        types: The data types of the dictionary.
    """
    for _ in range(BASES_MAX):
        found = types.get(name)
        if found is None or not found.base or found.arrays:
            break
        name = found.base
    return name


def read_access(flags: Element | None, findings: Findings, default: str) -> str:
    """Return "ro", "rw" or "wo".

    Args:
        flags: The element `Flags`; None if the file does not have it.
        findings: The warnings of the reader.
        default: The access without a valid element.
    """
    element = flags.find("Access") if flags is not None else None
    if element is None or not element.text.strip():
        return default
    found = ACCESS.get(element.text.strip().lower())
    if found is None:
        findings.warn(element, f"Access: {shown(element.text)} is unknown; read as {default}")
    return found or default


def read_pdo_mapping(flags: Element | None) -> str:
    """Return "R" (RxPDO), "T" (TxPDO), "RT", or an empty text."""
    text = text_of(flags, "PdoMapping").upper()
    return "".join(letter for letter in "RT" if letter in text)


def _data_type(element: Element, findings: Findings) -> EsiDataType:
    arrays = (_array(child, findings) for child in element.all("ArrayInfo"))
    members = (_member(child, findings) for child in element.all("SubItem"))
    return EsiDataType(
        name=text_of(element, "Name"),
        bit_length=findings.integer(element.find("BitSize")),
        base=text_of(element, "BaseType"),
        arrays=tuple(array for array in arrays if array is not None),
        members=tuple(members),
        enumeration=_enumeration(element, findings),
        source=findings.source(element),
    )


def _array(element: Element, findings: Findings) -> EsiArray | None:
    elements = findings.required(element, "Elements")
    if elements is None:
        return None
    lower = findings.integer(element.find("LBound"), bits=16, signed=True)
    return EsiArray(lower, elements)


def _member(element: Element, findings: Findings) -> EsiSubItem:
    flags = element.find("Flags")
    return EsiSubItem(
        name=text_of(element, "Name"),
        type=text_of(element, "Type"),
        bit_length=findings.integer(element.find("BitSize")),
        bit_offset=findings.integer(element.find("BitOffs")),
        subindex=findings.number(element.find("SubIdx"), bits=8),
        access=read_access(flags, findings, ""),
        pdo_mapping=read_pdo_mapping(flags),
        category=text_of(flags, "Category").lower(),
    )


def _enumeration(element: Element, findings: Findings) -> dict[int, str]:
    found: dict[int, str] = {}
    for child in element.all("EnumInfo"):
        value = findings.number(child.find("Enum"), signed=True)
        if value is None:
            findings.warn(child, "EnumInfo without a value is ignored")
        else:
            found.setdefault(value, text_of(child, "Text"))
    return found


def default_of(member: Element) -> Element | None:
    """Return the element with the default value of a member or object; None if it has none."""
    for tag in ("DefaultData", "DefaultValue", "DefaultString"):
        found = member.find(tag)
        if found is not None and plain_text(found.text):
            return found
    return None
