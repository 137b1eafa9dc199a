"""Devices of a library with the modules and dictionaries of other files."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from catenary.errors import EsiError
from catenary.esi.device import EsiDevice, EsiModule, EsiSlots
from catenary.esi.devices import Vendor, make_device
from catenary.esi.dictionary import EsiDictionary
from catenary.esi.findings import Findings
from catenary.esi.index import element_of
from catenary.esi.indexed_files import IndexedFiles, indexed_or_warned
from catenary.esi.modules import make_module, with_modules
from catenary.esi.objects import read_dictionary
from catenary.esi.record import FileIndex, IndexEntry, Kind, Record
from catenary.esi.references import resolve
from catenary.esi.source import EsiWarning, Source
from catenary.esi.xml import Element

MAX_FILES = 200  # that one device can refer to
MAX_MODULES = 2000  # of one device


class Assembly:
    """Reader of one device. It collects the warnings about other files."""

    def __init__(self, files: IndexedFiles) -> None:
        self._files = files
        self._warnings: list[EsiWarning] = []

    def device(self, record: Record) -> EsiDevice:
        """Return the device of an entry.

        Raises:
            EsiError: The file is missing, or has changed.
        """
        index = self._index(record.path)
        vendor = Vendor(index.vendor, index.vendor_name)
        device = make_device(_element(index, record.entry), vendor, Findings(index.path))
        if device.key != record.key:
            raise EsiError(
                f"the file has changed: {record.key} expected, {device.key} found",
                file=record.path,
                line=record.entry.line,
            )
        root = Path(record.root)
        device = replace(
            device,
            dictionary=device.dictionary
            or self._dictionary(device.dictionary_file, device.source, root),
        )
        device = with_modules(device, self._modules(index, device.slots, root))
        return replace(device, warnings=(*device.warnings, *self._warnings))

    def _modules(self, index: FileIndex, slots: EsiSlots | None, root: Path) -> list[EsiModule]:
        """Return the modules that the slots accept, each ident once, the nearest file first."""
        if slots is None:
            return []
        idents = {each for slot in slots.slots for each in slot.module_idents}
        classes = {each for slot in slots.slots for each in slot.module_classes}
        found: dict[int, EsiModule] = {}
        for file, entry in self._module_entries(index, root):
            accepted = entry.ident in idents or entry.module_class in classes
            if accepted and entry.ident not in found and len(found) < MAX_MODULES:
                found[entry.ident] = self._module(file, entry, root)
        for missing in sorted(idents - found.keys()):
            self._warn(slots.slots[0].source, f"module 0x{missing:08X} of a slot was not found")
        return list(found.values())

    def _module_entries(
        self, index: FileIndex, root: Path
    ) -> Iterator[tuple[FileIndex, IndexEntry]]:
        """Yield the modules of the file, of files that it refers to, and of the same vendor."""
        seen = set()
        for file in self._referenced(index, root):
            seen.add(file.path)
            for entry in self._entries(file, Kind.MODULE):
                yield file, entry
        others = self._files.records("kind='module' AND e.vendor=?", index.vendor)
        for record in others:
            if record.path not in seen:
                yield self._index(record.path), record.entry

    def _referenced(self, index: FileIndex, root: Path) -> Iterator[FileIndex]:
        """Yield a file and the files that it refers to, directly or not, each once."""
        waiting = deque([index])
        seen = {index.path}
        while waiting:
            file = waiting.popleft()
            yield file
            for target in file.references:
                path = self._resolved(target, Source(file.path, 1), root)
                if path is not None and str(path) not in seen and len(seen) < MAX_FILES:
                    seen.add(str(path))
                    waiting.append(self._index(str(path)))

    def _module(self, index: FileIndex, entry: IndexEntry, root: Path) -> EsiModule:
        findings = Findings(index.path)
        module = make_module(_element(index, entry), findings)
        self._warnings.extend(findings.warnings)
        if module.dictionary is not None or not module.dictionary_file:
            return module
        return replace(
            module, dictionary=self._dictionary(module.dictionary_file, module.source, root)
        )

    def _dictionary(self, target: str, source: Source, root: Path) -> EsiDictionary | None:
        """Return the dictionary in another file; None if there is none, with a warning."""
        path = self._resolved(target, source, root) if target else None
        if path is None:
            return None
        index = self._index(str(path))
        entries = self._entries(index, Kind.DICTIONARY)
        if not entries:
            self._warn(source, f"{path} has no dictionary")
            return None
        findings = Findings(index.path)
        dictionary = read_dictionary(_element(index, entries[0]), findings)
        self._warnings.extend(findings.warnings)
        return dictionary

    def _resolved(self, target: str, source: Source, root: Path) -> Path | None:
        path = resolve(target, Path(source.file), root)
        if path is None:
            self._warn(source, f"the file {target!r} was not found in {root}")
        return path

    def _index(self, path: str) -> FileIndex:
        """Return the index of a file. For a file of the library, it has no entries."""
        return self._files.file(path) or indexed_or_warned(path)

    def _entries(self, index: FileIndex, kind: Kind) -> list[IndexEntry]:
        found = self._files.records("e.path=? AND kind=?", index.path, kind.value)
        entries = [each.entry for each in found] or index.entries
        return [each for each in entries if each.kind is kind]

    def _warn(self, source: Source, text: str) -> None:
        if EsiWarning(source, text) not in self._warnings:
            self._warnings.append(EsiWarning(source, text))


def _element(index: FileIndex, entry: IndexEntry) -> Element:
    """Read one element from its place in the file.

    Raises:
        EsiError: The file cannot be read, or has changed.
    """
    try:
        with open(index.path, "rb") as opened:
            opened.seek(entry.offset)
            data = opened.read(entry.length)
    except OSError as error:
        raise EsiError(f"cannot be read: {error.strerror}", file=index.path) from error
    return element_of(data, entry, index.encoding, index.path)
