"""ESI files of a scan: the description of each device, completed from a library."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from catenary.errors import EsiError, EsiLookupError, IdentityError
from catenary.esi.folders import default_folder
from catenary.model.device import DeviceDescription

if TYPE_CHECKING:  # a scan without ESI files imports neither sqlite nor a parser
    from catenary.esi.device import EsiDevice
    from catenary.esi.library import Library
    from catenary.esi.lookup import Choice

SHOWN = 8  # devices in an error, or descriptions of one device

EsiFiles: TypeAlias = "str | os.PathLike[str] | Library"
EsiPlace: TypeAlias = "EsiFiles | Sequence[EsiFiles] | Literal[False] | None"


class EsiSource:
    """ESI descriptions for the devices of one scan. It remembers those that it used."""

    def __init__(self, libraries: Sequence[Library], *, given: bool) -> None:
        """Open the indices of the libraries.

        Args:
            libraries: Libraries of ESI files, the preferred one first.
            given: True if the application gave them; False for the user's own library.

        Raises:
            EsiError: A library cannot be read.
        """
        self.found: dict[int, EsiDevice] = {}  # by position
        self.notes = tuple(problem for each in libraries for problem in each.problems)
        self._libraries = tuple(libraries)
        self._given = given

    def complete(self, device: DeviceDescription) -> DeviceDescription:
        """Return the description with the facts of its ESI, or with a note that names the reason.

        A modular device is completed again when the idents of its modules are known.
        """
        if device.modular is not None and device.position in self.found:
            from catenary.esi.configured import with_reported_modules

            return with_reported_modules(device, self.found[device.position])
        if not device.identity.vendor:  # its SII cannot be used
            return device
        try:
            return self._applied(device)
        except (EsiError, IdentityError) as error:
            reason = error.message.removeprefix(f"{device}: ")
            return _noted(device, f"its ESI is not used: {reason}")

    def _applied(self, device: DeviceDescription) -> DeviceDescription:
        from catenary.esi.apply import applied
        from catenary.esi.duplicates import warning_of

        library, choice = self._choice(device)
        if library is None or choice is None:
            return device
        if choice.record is None:
            revisions = ", ".join(f"0x{each.entry.revision:08X}" for each in choice.candidates)
            return _noted(
                device,
                f"{library.path} has its ESI only for newer revisions than "
                f"0x{device.identity.revision:08X}: {revisions}",
            )
        esi = library.read(choice.record)
        completed = applied(device, esi)
        self.found[device.position] = esi
        more = choice.records[1:SHOWN]
        others = (warning_of(choice.record, other, library.read) for other in more)
        return _noted(completed, *map(str, others))

    def _choice(self, device: DeviceDescription) -> tuple[Library | None, Choice | None]:
        """Return the first library with a suitable description, or else with any of the product."""
        unsuitable: tuple[Library | None, Choice | None] = (None, None)
        for library in self._libraries:
            identity = device.identity
            choice = library.choose(
                identity.vendor, identity.product, identity.revision, order=device.order
            )
            if choice is not None and choice.record is not None:
                return library, choice
            if choice is not None:
                unsuitable = library, choice
        return unsuitable

    def check_used(self, devices: Sequence[DeviceDescription]) -> None:
        """Check that a given file or folder describes at least one device.

        Args:
            devices: Devices of the segment.

        Raises:
            EsiLookupError: It describes none of them. The message lists both.
        """
        if not self._given or self.found or not devices:
            return
        described = [str(each) for library in self._libraries for each in library.records()]
        shown = "".join(f"\n    {each}" for each in described[:SHOWN])
        shown += f"\n    and {len(described) - SHOWN} more" * (len(described) > SHOWN)
        present = ", ".join(
            f"{each} 0x{each.identity.vendor:08X}:0x{each.identity.product:08X}"
            for each in devices[:SHOWN]
        )
        raise EsiLookupError(
            f"describes none of the devices on the segment, which are {present}; it "
            + (f"describes{shown}" if described else "has no devices"),
            file=", ".join(str(library.path) for library in self._libraries),
            candidates=tuple(described),
            hint="use the ESI files of these devices, or omit esi=",
        )


def open_source(place: EsiPlace) -> EsiSource | None:
    """Return the ESI files of a scan; None without any.

    Args:
        place: File or folder, a library, or a list of these, the preferred one first. None: the
            library of the user if it exists. False: no ESI files.

    Raises:
        EsiError: A given file, folder or library cannot be read.
    """
    if place is False:
        return None
    if place is None:
        return _user_source()
    from catenary.esi.library import Library

    places: Sequence[EsiFiles] = [place]  # type: ignore[list-item]  # not a sequence
    if isinstance(place, Sequence) and not isinstance(place, str):
        places = place
    libraries = [each if isinstance(each, Library) else Library.of(each) for each in places]
    return EsiSource(libraries, given=True)


def _user_source() -> EsiSource | None:
    """Return the library of the user; None if it does not exist.

    A library that cannot be read does not prevent a scan: programs also run as other users, for
    example by sudo. A note reports it.
    """
    try:
        folder = default_folder()
    except RuntimeError:  # the user has no home directory
        return None
    try:
        if not folder.is_dir():
            return None
        from catenary.esi.library import Library

        return EsiSource([Library(folder)], given=False)
    except (OSError, EsiError) as error:
        source = EsiSource([], given=False)
        source.notes = (f"your library of ESI files is not used: {error}",)
        return source


def unchanged(device: DeviceDescription) -> DeviceDescription:
    """Return the description as it is: the completion of a scan without ESI files."""
    return device


def _noted(device: DeviceDescription, *notes: str) -> DeviceDescription:
    return replace(device, notes=(*device.notes, *notes))
