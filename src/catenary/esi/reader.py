"""Reader of ESI files (ETG.2000): devices, modules and dictionaries as values.

The reader is tolerant. A fault that it can ignore or repair becomes a warning with file and line. A
faulty device does not hide the other devices of its file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias, TypeVar

from catenary.errors import EsiError
from catenary.esi.device import EsiDevice, EsiFile, EsiModule
from catenary.esi.devices import Vendor, make_device, read_vendor
from catenary.esi.dictionary import EsiDictionary
from catenary.esi.document import Document, open_document
from catenary.esi.encoding import Encoding
from catenary.esi.findings import Findings, text_of
from catenary.esi.modules import make_module
from catenary.esi.objects import read_dictionary
from catenary.esi.source import EsiWarning, Source
from catenary.esi.values import file_name, plain_text
from catenary.esi.xml import Element, find_elements, read_fragment, root_tag

ROOTS = ("EtherCATInfo", "EtherCATModule", "EtherCATDict")
DEVICE_PATHS = frozenset({"Descriptions/Devices/Device", "Devices/Device"})
MODULE_PATHS = frozenset({"Descriptions/Modules/Module", "Modules/Module"})
DICTIONARY_PATHS = frozenset({"Dictionary"})
VENDOR_PATHS = frozenset({"Vendor", "Descriptions/Vendor"})
GROUP_PATHS = frozenset({"Descriptions/Groups/Group", "Groups/Group"})
REFERENCE_PATHS = frozenset({"InfoReference", "Descriptions/InfoReference"})
FACTS = VENDOR_PATHS | GROUP_PATHS | REFERENCE_PATHS
NAMES = frozenset({"Id", "Name", "Type"})
REFERENCES_MAX = 100

# Returns the document of a referenced file, by its name with slashes; None if it was not found.
References: TypeAlias = Callable[[str], Document | None]
Holder = TypeVar("Holder", EsiDevice, EsiModule)


def read_esi(path: str | Path, *, references: References | None = None) -> EsiFile:
    """Read an ESI file.

    Args:
        path: The file, with the root EtherCATInfo, EtherCATModule or EtherCATDict.
        references: Access to the files that it names (`InfoReference`, `DictionaryFile`). None
            leaves them unread; their names are in the result.

    Raises:
        EsiError: The file cannot be read, or contains nothing that can be used.
    """
    return read_document(open_document(path), references=references)


def read_document(document: Document, *, references: References | None = None) -> EsiFile:
    """Read the contents of an ESI file.

    Args:
        document: The contents (`make_document`).
        references: As in `read_esi`.

    Raises:
        EsiError: The document is not an ESI file, or contains nothing that can be used.
    """
    root = root_tag(document)
    if root not in ROOTS:
        raise EsiError(
            f"the root element is {root[:60]!r}, not one of {', '.join(ROOTS)}",
            file=document.file,
            line=document.line,
            hint="choose an EtherCAT device description (ESI)",
        )
    pass_ = _Pass(document, references)
    if root == "EtherCATDict":
        dictionary = pass_.dictionary(document)
        if dictionary is None:
            raise EsiError("the file has no dictionary", file=document.file)
        return EsiFile(document.file, 0, "", dictionary=dictionary, warnings=pass_.warnings)
    return pass_.file()


def read_device(
    data: bytes,
    encoding: Encoding,
    *,
    file: str,
    line: int,
    vendor: Vendor,
    modules: Iterable[EsiModule] = (),
) -> EsiDevice:
    """Return one device from the bytes of its element.

    Args:
        data: The bytes at the place of the element (`find_elements`).
        encoding: The encoding of the file.
        file: The name of the file for messages.
        line: The line of the element in the file.
        vendor: The vendor of the file.
        modules: Modules for the slots of the device.

    Raises:
        EsiError: The bytes are not one device, or it has no valid identification.
    """
    element = read_fragment(data, encoding, file=file, line=line)
    return make_device(element, vendor, Findings(file), modules)


def read_module(data: bytes, encoding: Encoding, *, file: str, line: int) -> EsiModule:
    """Return one module from the bytes of its element.

    Args:
        data: The bytes at the place of the element (`find_elements`).
        encoding: The encoding of the file.
        file: The name of the file for messages.
        line: The line of the element in the file.

    Raises:
        EsiError: The bytes are not one module, or it has no valid identification.
    """
    return make_module(read_fragment(data, encoding, file=file, line=line), Findings(file))


class _Pass:
    """One pass over a file and the files that it references. It owns the warnings of the file."""

    def __init__(self, document: Document, references: References | None) -> None:
        self.document = document
        self.references = references
        self.findings = Findings(document.file)
        self.findings.warnings.extend(document.warnings)
        self.first_fault: EsiError | None = None
        self._has_vendor = False
        self._dictionaries: dict[str, EsiDictionary | None] = {}

    @property
    def warnings(self) -> tuple[EsiWarning, ...]:
        """Warnings that do not belong to a single device."""
        return tuple(self.findings.warnings)

    def file(self) -> EsiFile:
        """Return the contents of a file with devices or modules."""
        vendor, groups, names = self._facts()
        modules = self._modules(self.document)
        for name in names:
            modules += self._modules_of(name)
        devices = self._devices(vendor, modules)
        if not devices and not modules:
            if self.first_fault is not None:
                raise self.first_fault
            raise EsiError("the file has no devices and no modules", file=self.document.file)
        return EsiFile(
            path=self.document.file,
            vendor=vendor.number,
            vendor_name=vendor.name,
            devices=tuple(devices),
            modules=tuple(modules),
            groups=groups,
            references=names,
            warnings=self.warnings,
        )

    def dictionary(self, document: Document) -> EsiDictionary | None:
        """Return the dictionary of a file with the root EtherCATDict; None without one."""
        findings = self.findings
        if document is not self.document:
            findings = Findings(document.file)
        found = [
            read_dictionary(item.element, findings)
            for item in find_elements(document, DICTIONARY_PATHS)
        ]
        if findings is not self.findings:
            self.findings.warnings.extend(findings.warnings)
        return found[0] if found else None

    def _facts(self) -> tuple[Vendor, dict[str, str], tuple[str, ...]]:
        """Return the vendor, the names of the groups, and the referenced files."""
        vendor: Element | None = None
        groups: dict[str, str] = {}
        names: dict[str, None] = {}
        for found in find_elements(self.document, FACTS, kept=NAMES):
            if found.path in VENDOR_PATHS:
                vendor = vendor or found.element
            elif found.path in GROUP_PATHS:
                groups.setdefault(text_of(found.element, "Type"), text_of(found.element, "Name"))
            elif plain_text(found.element.text) and len(names) < REFERENCES_MAX:
                names[file_name(found.element.text)] = None
        self._has_vendor = vendor is not None
        return read_vendor(vendor, self.findings, Vendor(0)), groups, tuple(names)

    def _devices(self, vendor: Vendor, modules: list[EsiModule]) -> list[EsiDevice]:
        devices = []
        for found in find_elements(self.document, DEVICE_PATHS):
            try:
                findings = Findings(self.document.file)
                device = make_device(found.element, vendor, findings, modules)
            except EsiError as error:
                self._skip(error, "device", found.element.line)
                continue
            if not self._has_vendor and found.element.find("Vendor") is None:
                self._warn(found.element.line, "neither file nor device has a vendor; 0 assumed")
            devices.append(self._with_dictionary(device))
        return devices

    def _modules_of(self, name: str) -> list[EsiModule]:
        """Return the modules of a referenced file; none if it is faulty."""
        document = self._referenced(name)
        try:
            return self._modules(document) if document is not None else []
        except EsiError as error:
            self._skip(error, "referenced file", self.document.line)
            return []

    def _modules(self, document: Document) -> list[EsiModule]:
        modules = []
        for found in find_elements(document, MODULE_PATHS):
            findings = Findings(document.file)
            try:
                module = make_module(found.element, findings)
            except EsiError as error:
                self._skip(error, "module", found.element.line)
                continue
            self.findings.warnings.extend(findings.warnings)
            modules.append(self._with_dictionary(module))
        return modules

    def _with_dictionary(self, holder: Holder) -> Holder:
        """Return a device or module with the dictionary of another file, if it names one."""
        name = holder.dictionary_file
        if holder.dictionary is not None or not name:
            return holder
        if name not in self._dictionaries:
            self._dictionaries[name] = self._dictionary_of(name)
        return replace(holder, dictionary=self._dictionaries[name])

    def _dictionary_of(self, name: str) -> EsiDictionary | None:
        """Return the dictionary of a referenced file; None if it is faulty."""
        document = self._referenced(name)
        try:
            return self.dictionary(document) if document is not None else None
        except EsiError as error:
            self._skip(error, "referenced file", self.document.line)
            return None

    def _referenced(self, name: str) -> Document | None:
        """Return a referenced file; warn if it cannot be used."""
        if self.references is None:
            return None
        try:
            found = self.references(name)
            if found is not None and root_tag(found) in ROOTS:
                return found
            reason = "was not found" if found is None else "is not an ESI file"
            self._warn(self.document.line, f"the referenced file {name!r} {reason}")
        except EsiError as error:
            self._skip(error, "referenced file", self.document.line)
        return None

    def _skip(self, error: EsiError, what: str, line: int) -> None:
        self.first_fault = self.first_fault or error
        self._warn(error.line or line, f"{error.reason}; the {what} is ignored", error.file)

    def _warn(self, line: int, message: str, file: str = "") -> None:
        source = Source(file or self.document.file, line)
        self.findings.warnings.append(EsiWarning(source, message))
