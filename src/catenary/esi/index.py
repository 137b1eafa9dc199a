"""Index of one ESI file: its devices and modules, and their places in it.

The index is made in one pass, without the contents of devices.
Files of modules (root EtherCATModule) and of dictionaries (EtherCATDict) are indexed, too.
Files are not checked against the schema. Elements are found by their path, in every kind of file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from catenary.errors import EsiError
from catenary.esi.device import DeviceKey, RevisionCheck
from catenary.esi.devices import Vendor, read_key, read_vendor
from catenary.esi.document import Document, open_document
from catenary.esi.encoding import encoding_by_name
from catenary.esi.findings import Findings, text_of
from catenary.esi.reader import (
    DEVICE_PATHS,
    DICTIONARY_PATHS,
    FACTS,
    GROUP_PATHS,
    MODULE_PATHS,
    NAMES,
    REFERENCE_PATHS,
    REFERENCES_MAX,
    ROOTS,
    VENDOR_PATHS,
)
from catenary.esi.record import FileIndex, IndexEntry, Kind
from catenary.esi.source import EsiWarning, Source
from catenary.esi.values import file_name
from catenary.esi.xml import Element, Found, find_elements, read_fragment, root_tag

KINDS = {
    **dict.fromkeys(DEVICE_PATHS, Kind.DEVICE),
    **dict.fromkeys(MODULE_PATHS, Kind.MODULE),
    **dict.fromkeys(DICTIONARY_PATHS, Kind.DICTIONARY),
}
WANTED = frozenset(KINDS) | FACTS
KEPT = NAMES | {"HideType", "Vendor"}
KNOWN_CHECKS = frozenset(each.value for each in RevisionCheck)
MAX_ENTRIES = 50_000  # of one file


def index_file(path: str | Path) -> FileIndex:
    """Return the index of a file.

    Raises:
        EsiError: The file cannot be read, or is not well-formed.
    """
    return index_document(open_document(path))


def index_document(document: Document) -> FileIndex:
    """Return the index of the bytes of a file.

    Raises:
        EsiError: The document is not well-formed, or has too many entries.
    """
    findings = Findings(document.file)
    found = _elements(document)
    vendors = [each.element for each in found if each.path in VENDOR_PATHS]
    vendor = read_vendor(vendors[0] if vendors else None, findings, Vendor(0))
    groups = [each.element for each in found if each.path in GROUP_PATHS]
    references = [file_name(each.element.text) for each in found if each.path in REFERENCE_PATHS]
    described = [each for each in found if each.path in KINDS]
    entries = [_entry(KINDS[each.path], each, vendor, findings) for each in described]
    warnings = (*document.warnings, *findings.warnings)
    return FileIndex(
        document.file,
        encoding=document.encoding.name,
        vendor=vendor.number,
        vendor_name=vendor.name,
        entries=tuple(each for each in entries if each is not None),
        groups={text_of(group, "Type"): text_of(group, "Name") for group in groups},
        references=tuple(each for each in references if each)[:REFERENCES_MAX],
        warnings=warnings if described else (*warnings, _nothing_found(document)),
    )


def _elements(document: Document) -> list[Found]:
    found = []
    for each in find_elements(document, WANTED, kept=KEPT):
        found.append(each)
        if len(found) > MAX_ENTRIES:
            raise EsiError(f"more than {MAX_ENTRIES} devices and modules", file=document.file)
    return found


def element_of(data: bytes, entry: IndexEntry, encoding: str, file: str) -> Element:
    """Return the whole tree of an entry.

    Args:
        data: Bytes at the place of the entry.
        entry: The entry.
        encoding: Encoding of the file.
        file: Name of the file.

    Raises:
        EsiError: The bytes are not one element: the file has changed.
    """
    known = encoding_by_name(encoding)
    if known is None:
        raise EsiError(f"the encoding {encoding} is not supported", file=file)
    return read_fragment(data, known, file=file, line=entry.line)


def _entry(kind: Kind, found: Found, vendor: Vendor, findings: Findings) -> IndexEntry | None:
    """Return the entry of an element; None with a warning if it has no valid identification."""
    element = found.element
    common = IndexEntry(kind, found.offset, found.length, element.line, vendor.number)
    try:
        if kind is Kind.DEVICE:
            return _device(common, element, vendor, findings)
        return _module(common, element, findings) if kind is Kind.MODULE else common
    except EsiError as error:
        findings.warn(element, f"{error.reason}; the {kind} is ignored")
        return None


def _device(common: IndexEntry, element: Element, vendor: Vendor, findings: Findings) -> IndexEntry:
    key = read_key(element, vendor, findings)
    type_element = element.find("Type")
    return replace(
        common,
        vendor=key.vendor,
        product=key.product,
        revision=key.revision,
        type=text_of(element, "Type"),
        name=text_of(element, "Name"),
        revision_check=_check(type_element) if type_element is not None else RevisionCheck.NONE,
        hides=_hides(element, findings, key),
    )


def _module(common: IndexEntry, element: Element, findings: Findings) -> IndexEntry:
    type_element = element.find("Type")
    ident = findings.number(type_element, "ModuleIdent")
    if type_element is None or ident is None:
        raise EsiError("no valid ModuleIdent", file=findings.file, line=element.line)
    return replace(
        common,
        ident=ident,
        module_class=type_element.attributes.get("ModuleClass", "").strip(),
        type=text_of(element, "Type"),
        name=text_of(element, "Name"),
    )


def _check(element: Element) -> RevisionCheck:
    """Return the rule for the revision. The reader of the device warns about an unknown one."""
    text = element.attributes.get("CheckRevisionNo", "").strip()
    return RevisionCheck(text) if text in KNOWN_CHECKS else RevisionCheck.NONE


def _hides(element: Element, findings: Findings, own: DeviceKey) -> tuple[DeviceKey, ...]:
    """Return the hidden keys. A missing product code is that of the device."""
    keys = []
    for each in element.all("HideType"):
        revision = findings.number(each, "RevisionNo")
        if revision is not None:
            product = findings.integer(each, "ProductCode", default=own.product)
            keys.append(DeviceKey(own.vendor, product, revision))
    return tuple(keys)


def _nothing_found(document: Document) -> EsiWarning:
    root = root_tag(document)
    text = "no device, module or dictionary" if root in ROOTS else f"not an ESI file: root {root}"
    return EsiWarning(Source(document.file, document.line), text)
