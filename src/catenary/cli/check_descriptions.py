"""ESIs of `catenary check --against`: which files are used, and which description fits a device."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from catenary.bus import SubDevice
from catenary.cli.esi_commands import open_library
from catenary.errors import EsiError
from catenary.esi.device import EsiDevice
from catenary.esi.library import ADD_HINT, Library

SHOWN = 5  # descriptions that a message lists


class Description(NamedTuple):
    """The ESI of a device, the rule by which it was chosen, and notes about the choice."""

    esi: EsiDevice
    rule: str
    notes: tuple[str, ...] = ()


class Descriptions:
    """ESI files of one command. It owns their libraries."""

    def __init__(self, libraries: Sequence[Library]) -> None:
        self._libraries = tuple(libraries)

    @classmethod
    def of(cls, against: str, places: Sequence[Path] | None) -> Descriptions:
        """Return the ESI files of the option.

        Args:
            against: File or folder; empty for those of the machine file, or the user's library.
            places: ESI files and folders of the machine file; None if it gives none.

        Raises:
            EsiError: A file or folder does not exist, or contains no description.
        """
        if against:
            return cls([_opened(against)])
        return cls([_opened(str(each)) for each in places] if places else [open_library(None)])

    def __enter__(self) -> Descriptions:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for each in self._libraries:
            each.close()

    def find(self, sub: SubDevice, *, single: bool) -> Description | None:
        """Return the description of a device; None if there is none.

        Args:
            sub: The device.
            single: True if it is the only device to compare. If the files describe only one
                product, this description is then returned even for another device.

        Raises:
            EsiError: The file cannot be read.
        """
        identity = sub.identity
        chosen = [
            (library, choice)
            for library in self._libraries
            if (choice := library.choose(*identity[:3], order=sub.order)) is not None
        ]
        chosen.sort(key=lambda each: each[1].record is None)  # suitable revisions first
        for library, choice in chosen[:1]:
            record = choice.record or choice.candidates[-1]
            others = tuple(f"{each.source} also describes it" for each in choice.records[1:])
            return Description(library.read(record), str(choice.rule), others[:SHOWN])
        records = [(library, each) for library in self._libraries for each in library.records()]
        if single and len({each.key[:2] for _, each in records}) == 1:
            library, record = records[0]
            return Description(library.read(record), "the only product")
        return None

    def missing(self, sub: SubDevice, *, single: bool) -> str:
        """Return the message for a device without a description.

        Args:
            sub: The device.
            single: True to list what the files describe.
        """
        vendor, product = sub.identity.vendor, sub.identity.product
        places = ", ".join(str(each.path) for each in self._libraries)
        text = f"no description of 0x{vendor:08X}:0x{product:08X} in {places}"
        names = [
            f"{each.entry.type} ({each.key})"
            for library in self._libraries
            for each in library.records()
        ]
        if not names:
            return f"{text}: it is empty ({ADD_HINT})"
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        return f"{text}, which describes {', '.join(names[:SHOWN])}{more}" if single else text


def _opened(path: str) -> Library:
    library = open_library(path) if Path(path).exists() else Library.of(path)
    if library.records():
        return library
    faults = [fault for file in library.files for fault in file.warnings]
    library.close()
    if not faults:
        raise EsiError("no device description found", file=str(library.path), hint=ADD_HINT)
    raise EsiError(
        faults[0].message,
        file=faults[0].source.file,
        line=faults[0].source.line,
        hint="ask the vendor for an intact ESI file",
    )
