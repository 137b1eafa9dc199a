"""PDOs of an ESI device or module (`RxPdo`, `TxPdo`; ETG.2000, PdoType)."""

from __future__ import annotations

from catenary.esi.device import EsiEntry, EsiPdo
from catenary.esi.findings import Findings, text_of
from catenary.esi.values import plain_text
from catenary.esi.xml import Element
from catenary.model.device import Direction
from catenary.types import by_name

DIRECTIONS = {"RxPdo": Direction.OUTPUT, "TxPdo": Direction.INPUT}


def read_pdos(parent: Element, findings: Findings) -> tuple[EsiPdo, ...]:
    """Return the PDOs of a device or module, in the order of the file.

    Args:
        parent: The device or module.
        findings: The warnings of the reader.
    """
    pdos: list[EsiPdo] = []
    seen: set[tuple[Direction, int]] = set()
    for element in parent.all(*DIRECTIONS):
        pdo = _pdo(element, findings)
        if pdo is None:
            continue
        if (pdo.direction, pdo.index) in seen:
            findings.warn(element, f"PDO 0x{pdo.index:04X} occurs more than once")
        seen.add((pdo.direction, pdo.index))
        pdos.append(pdo)
    return tuple(pdos)


def _pdo(element: Element, findings: Findings) -> EsiPdo | None:
    index = findings.required(element, "Index", bits=16)
    if index is None:
        return None
    excludes = element.all("Exclude")
    entries = (_entry(entry, findings) for entry in element.all("Entry"))
    numbers = (findings.number(exclude, bits=16) for exclude in excludes)
    managers = (findings.number(excluded, bits=8) for excluded in element.all("ExcludedSm"))
    return EsiPdo(
        direction=DIRECTIONS[element.tag],
        index=index,
        name=text_of(element, "Name"),
        entries=tuple(entry for entry in entries if entry is not None),
        sync_manager=findings.number(element, "Sm", bits=8),
        fixed=findings.flag(element, "Fixed"),
        mandatory=findings.flag(element, "Mandatory"),
        virtual=findings.flag(element, "Virtual"),
        excludes=frozenset(number for number in numbers if number is not None),
        excluded_sync_managers=frozenset(number for number in managers if number is not None),
        oversampling_max=findings.integer(element, "OSMax", bits=16),
        depends_on_slot=findings.flag(element.find("Index"), "DependOnSlot"),
        excludes_depend_on_slot=any(findings.flag(each, "DependOnSlot") for each in excludes),
        overwritten_by_module=findings.flag(element, "OverwrittenByModule"),
        source=findings.source(element),
    )


def _entry(element: Element, findings: Findings) -> EsiEntry | None:
    """Return an entry; None for a gap of 0 bits."""
    type_name = text_of(element, "DataType")
    index = findings.required(element, "Index", bits=16, reaction="read as a gap") or 0
    bit_length = findings.number(element.find("BitLen"), bits=16)
    if bit_length is None:
        bit_length = _length_of_type(type_name)
        findings.warn(
            element, f"Entry has no valid BitLen; {bit_length} bits assumed from its type"
        )
    if not bit_length:
        reaction = "kept" if index else "ignored"
        findings.warn(element, f"entry 0x{index:04X} has 0 bits; {reaction}")
        if not index:
            return None
    comment = element.find("Comment")
    return EsiEntry(
        index=index,
        subindex=findings.integer(element.find("SubIndex"), bits=8),
        bit_length=bit_length,
        name=text_of(element, "Name"),
        type=type_name,
        fixed=findings.flag(element, "Fixed"),
        depends_on_slot=findings.flag(element.find("Index"), "DependOnSlot"),
        comment=plain_text(comment.text) if comment is not None else "",
    )


def _length_of_type(name: str) -> int:
    try:
        return by_name(name).bit_length
    except ValueError:
        return 0
