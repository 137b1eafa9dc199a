"""Library of ESI files: descriptions by vendor, product and revision, modules and dictionaries."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections import deque
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from types import TracebackType
from zipfile import is_zipfile

from catenary.errors import EsiError, EsiLookupError
from catenary.esi.archive import extract
from catenary.esi.assembly import Assembly
from catenary.esi.device import DeviceKey, EsiDevice
from catenary.esi.duplicates import warning_of
from catenary.esi.folders import cache_folder, default_folder, is_small
from catenary.esi.indexed_files import IndexedFiles
from catenary.esi.lookup import Choice, Rule, choose, hidden_keys
from catenary.esi.record import FileIndex, Kind, Record
from catenary.esi.source import EsiWarning
from catenary.esi.sources import locked, read_sources, walk, write_sources
from catenary.esi.store import MEMORY

ADD_HINT = "add the vendor's ESI file: catenary esi add FILE"
MAX_DUPLICATES = 10  # that one lookup compares
MAX_NAMES = 20_000  # compared with a name that was not found


@dataclass(frozen=True, slots=True)
class Added:
    """Result of `Library.add`."""

    path: str  # file or folder in the library
    files: tuple[FileIndex, ...]  # without their entries
    devices: int
    modules: int
    dictionaries: int
    problems: tuple[str, ...] = ()  # folders and files that cannot be read


class Library:
    """ESI files of a user. It owns a folder with the list of files and their index.

        library = Library()
        library.add("Beckhoff_EtherCAT_XML.zip")
        device = library.find(vendor=2, product=0x07D43052, revision=0x00120000)

    Added files stay where they are; archives are extracted into the folder. Files that you copy
    into the folder are found, too. Several processes can use a library at the same time.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None) -> None:
        """Open a library. Nothing is created before the first `add`.

        Args:
            path: Folder of the library; None for the user's own: `CATENARY_ESI`, or
                `catenary/esi` in the user's data folder (`XDG_DATA_HOME`, ~/.local/share).
        """
        self.path = Path(os.path.abspath(path)) if path is not None else default_folder()
        self._temporary = False
        self._opened: IndexedFiles | None = None

    @classmethod
    def of(cls, path: str | os.PathLike[str]) -> Library:
        """Return a library of one folder or file, for this process. Nothing is written to it.

        Args:
            path: A folder with ESI files, or one ESI file.

        Raises:
            EsiError: The path does not exist, or is an archive.
        """
        library = cls(path)
        if not library.path.exists():
            raise EsiError("no such file or folder", file=str(path), hint="check the path")
        if library.path.is_file() and is_zipfile(library.path):
            raise EsiError(
                "an archive cannot be read in place",
                file=str(path),
                hint=f"add it to your library: catenary esi add {path}",
            )
        library._temporary = True
        return library

    def __enter__(self) -> Library:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Library {str(self.path)!r}>"

    def close(self) -> None:
        """Close the index. The library opens it again when needed."""
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    # contents

    def add(self, path: str | os.PathLike[str]) -> Added:
        """Add a file, a folder with its subfolders, or a ZIP archive.

        A path that the library has is checked again, by content, and becomes the preferred one.

        Args:
            path: The file, folder or archive.

        Raises:
            EsiError: The path does not exist, the folder is too large, or the archive is unsafe.
            ValueError: The library is a temporary one (`of`).
        """
        given = Path(os.path.abspath(path))
        self._check_permanent()
        if not given.exists():
            raise EsiError("no such file or folder", file=str(path), hint="check the path")
        self.path.mkdir(parents=True, exist_ok=True)
        archive = given.is_file() and is_zipfile(given)
        if given.is_file() and not archive and given.suffix.lower() != ".xml":
            raise EsiError(
                "neither an XML file, a ZIP archive nor a folder",
                file=str(path),
                hint="unpack it, and add the XML files",
            )
        if given.is_dir():
            deque(walk(given, []), maxlen=0)  # an error before anything is changed
        with locked(self._lock):
            source = self._extracted(given) if archive else given
            others = [each for each in self._listed() if each != source]
            write_sources(self._list, [*others, source])
        self.close()  # its index may have been in memory, without a folder
        files = self._files()
        files.refresh(all_hashes=True)
        return self._added(files, source)

    def _check_permanent(self) -> None:
        if self._temporary:
            raise ValueError("a library from `Library.of` cannot be changed; use `Library()`")

    def _extracted(self, archive: Path) -> Path:
        """Extract an archive into the library, and return the folder."""
        with open(archive, "rb") as opened:
            digest = hashlib.file_digest(opened, "sha256").hexdigest()
        stem = re.sub(r"[^\w.-]", "_", archive.stem).lstrip(".")[:80]
        folder = self.path / "archives" / f"{stem}-{digest[:12]}"
        folder.parent.mkdir(exist_ok=True)
        extract(archive, folder)
        return folder

    def _added(self, files: IndexedFiles, source: Path) -> Added:
        def within(path: str) -> bool:
            return Path(path).is_relative_to(source)

        kinds = [each.entry.kind for each in files.records() if within(each.path)]
        return Added(
            str(source),
            tuple(each for each in files.files() if within(each.path)),
            kinds.count(Kind.DEVICE),
            kinds.count(Kind.MODULE),
            kinds.count(Kind.DICTIONARY),
            files.problems,
        )

    def remove(self, path: str | os.PathLike[str]) -> None:
        """Remove a file or folder from the library. Your own files are not deleted.

        The extracted copy of an archive is deleted.

        Args:
            path: The path as `sources` has it.

        Raises:
            EsiError: The library does not list this path.
            ValueError: The library is a temporary one (`of`).
        """
        given = Path(os.path.abspath(path))
        self._check_permanent()
        if given not in self.sources:
            raise EsiError(
                f"the library {self.path} does not list this path",
                file=str(path),
                hint="see its paths: catenary esi list --files",
            )
        with locked(self._lock):
            write_sources(self._list, [each for each in self._listed() if each != given])
            if given.parent == self.path / "archives" and given.is_dir():
                shutil.rmtree(given)
        self._files().refresh()

    @property
    def sources(self) -> tuple[Path, ...]:
        """Added files and folders, in their order."""
        return tuple(self._listed())

    @property
    def files(self) -> tuple[FileIndex, ...]:
        """Files with their warnings, in the order of their paths, without entries."""
        return tuple(self._files().files())

    @property
    def problems(self) -> tuple[str, ...]:
        """Missing and unreadable files and folders."""
        return self._files().problems

    @property
    def _list(self) -> Path:
        return self.path / "library.json"

    @property
    def _lock(self) -> Path:
        return self.path / "lock"

    def _listed(self) -> list[Path]:
        return [] if self._temporary else read_sources(self._list)

    def _all_sources(self) -> list[Path]:
        own = [self.path] if self._temporary or self.path.is_dir() else []
        return [*own, *self._listed()]

    def _files(self) -> IndexedFiles:
        """Return the files. They are compared with their index when the library is opened."""
        if self._opened is None:
            self._opened = IndexedFiles(self._all_sources, *self._index_and_lock())
            self._opened.refresh()
        return self._opened

    def _index_and_lock(self) -> tuple[str, Path | None]:
        if not self._temporary and self.path.is_dir():
            return str(self.path / "index.sqlite"), self._lock
        folder = cache_folder() if self._temporary else None
        if folder is None or is_small(self.path):
            return MEMORY, None
        name = hashlib.sha256(os.fsencode(self.path)).hexdigest()[:16]
        return str(folder / f"{name}.sqlite"), folder / f"{name}.lock"

    # lookup

    def records(self, kind: Kind = Kind.DEVICE) -> list[Record]:
        """Return all entries of one kind, the preferred ones first."""
        return self._files().records("kind=?", kind.value)

    def choose(
        self, vendor: int, product: int, revision: int | None = None, *, order: str = ""
    ) -> Choice | None:
        """Choose among the descriptions of a product; None if the library has none.

        The exact revision is preferred, then the newest one that is not above the device's.

        Args:
            vendor: Vendor ID.
            product: Product code.
            revision: Revision of the device; None for the newest description.
            order: Order code, which decides between descriptions with the same numbers.
        """
        records = self._files().records(
            "kind='device' AND e.vendor=? AND product=?", vendor, product
        )
        return choose(records, revision, order)

    def find(
        self, vendor: int, product: int, revision: int | None = None, *, order: str = ""
    ) -> EsiDevice | None:
        """Return the description of a device; None if the library does not have the product.

        Its warnings name the rule, if the revision differs, and other files with the same key.

        Args:
            vendor: Vendor ID.
            product: Product code.
            revision: Revision of the device; None for the newest description.
            order: Order code, which decides between descriptions with the same numbers.

        Raises:
            EsiLookupError: The library has only newer revisions. The message lists them.
            EsiError: The file cannot be read.
        """
        choice = self.choose(vendor, product, revision, order=order)
        if choice is None:
            return None
        if choice.record is None:
            raise self._only_newer(DeviceKey(vendor, product, revision or 0), choice)
        device = self.read(choice.record)
        return replace(device, warnings=(*self._notes(choice, revision), *device.warnings))

    def _only_newer(self, key: DeviceKey, choice: Choice) -> EsiLookupError:
        shown = [str(each) for each in choice.candidates]
        found = ", ".join(f"0x{each.entry.revision:08X}" for each in choice.candidates)
        return EsiLookupError(
            f"no description fits {key}: the library has only newer revisions: {found}",
            file=str(self.path),
            candidates=tuple(shown),
            hint="add the vendor's file for this revision, or choose one of these yourself",
        )

    def _notes(self, choice: Choice, revision: int | None) -> list[EsiWarning]:
        """Return the warnings of a lookup: another revision, and other files with the same key."""
        record = choice.record
        assert record is not None
        others = choice.records[1 : 1 + MAX_DUPLICATES]
        notes = [warning_of(record, other, self.read) for other in others]
        if revision is not None and choice.rule is not Rule.EXACT:
            text = (
                f"revision 0x{record.entry.revision:08X} is used for a device of revision "
                f"0x{revision:08X} ({choice.rule})"
            )
            notes.insert(0, EsiWarning(record.source, text))
        return notes

    def search(self, text: str) -> list[Record]:
        """Return devices by name: order code, or else a part of order code or name.

        Hidden revisions are omitted, unless all of them are hidden. Case does not matter.

        Args:
            text: Order code such as "EL2004", or a part of a name.
        """
        devices = self.records()
        wanted = " ".join(text.split()).casefold()
        exact = [each for each in devices if each.entry.type.casefold() == wanted]
        found = exact or [each for each in devices if wanted in _words(each)]
        hidden = hidden_keys(found)
        shown = [each for each in found if each.key not in hidden] or found
        return sorted(shown, key=lambda each: (each.entry.type, -each.entry.revision))

    def near(self, text: str) -> list[str]:
        """Return order codes of devices with similar names, the most similar one first."""
        types: dict[str, str] = {}
        for each in (record.entry for record in self.records()[:MAX_NAMES]):
            types.update(dict.fromkeys((each.type.casefold(), each.name.casefold()), each.type))
        found = get_close_matches(text.casefold(), types, n=5)
        return list(dict.fromkeys(types[each] for each in found))

    def check(self) -> list[str]:
        """Compare every file with the index by content, and return what is wrong.

        These are missing and unreadable files, and devices that several files describe.
        """
        files = self._files()
        files.refresh(all_hashes=True)
        return [*files.problems, *(str(each) for each in self._duplicates())]

    def _duplicates(self) -> list[EsiWarning]:
        """Return a warning for each further description of the same device."""
        first: dict[DeviceKey, Record] = {}
        found = []
        for record in self.records():
            used = first.setdefault(record.key, record)
            if used is not record:
                found.append(warning_of(used, record, self.read))
        return found

    def read(self, record: Record) -> EsiDevice:
        """Read one device from its place in the file, with its modules and dictionary.

        If the file has changed since the library was opened, it is indexed again.

        Args:
            record: Entry of this library.

        Raises:
            EsiError: The file is missing, or does not describe this device any more.
        """
        try:
            return Assembly(self._files()).device(record)
        except EsiError:
            self._files().refresh(all_hashes=True)
            now = [
                each
                for each in self.records()
                if (each.path, each.key) == (record.path, record.key)
            ]
            if record in now or not now:
                raise
            return Assembly(self._files()).device(now[0])


def _words(record: Record) -> str:
    return " ".join(f"{record.entry.type} {record.entry.name}".split()).casefold()
