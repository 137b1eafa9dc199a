"""ESI files of a scan: the description of each device, completed from a library."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from catenary.errors import EsiError, EsiLookupError, IdentityError
from catenary.esi.user_folder import default_folder
from catenary.model.device import DeviceDescription

if TYPE_CHECKING:  # a scan without ESI files imports neither sqlite nor a parser
    from catenary.esi.device import EsiDevice
    from catenary.esi.library import Library

SHOWN = 8  # devices in an error

EsiPlace: TypeAlias = "str | os.PathLike[str] | Library | Literal[False] | None"


class EsiSource:
    """ESI descriptions for the devices of one scan. It remembers those that it used."""

    def __init__(self, library: Library, *, given: bool) -> None:
        """Open the index of the library.

        Args:
            library: Library of ESI files.
            given: True if the application gave it; False for the user's own library.

        Raises:
            EsiError: The library cannot be read.
        """
        self.found: dict[int, EsiDevice] = {}  # by position
        self.notes = tuple(library.problems)
        self._library = library
        self._given = given

    def complete(self, device: DeviceDescription) -> DeviceDescription:
        """Return the description with the facts of its ESI, or with a note why not.

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

        identity = device.identity
        choice = self._library.choose(identity.vendor, identity.product, identity.revision)
        if choice is None:
            return device
        if choice.record is None:
            revisions = ", ".join(f"0x{each.entry.revision:08X}" for each in choice.candidates)
            return _noted(
                device,
                f"{self._library.path} has its ESI only for newer revisions than "
                f"0x{identity.revision:08X}: {revisions}",
            )
        esi = self._library.read(choice.record)
        completed = applied(device, esi)
        self.found[device.position] = esi
        others = (
            warning_of(choice.record, other, self._library.read) for other in choice.records[1:]
        )
        return _noted(completed, *map(str, others))

    def check_used(self, devices: Sequence[DeviceDescription]) -> None:
        """Check that a given file or folder describes at least one device.

        Args:
            devices: Devices of the segment.

        Raises:
            EsiLookupError: It describes none of them. The message lists both.
        """
        if not self._given or self.found or not devices:
            return
        described = [str(each) for each in self._library.records()]
        shown = "".join(f"\n    {each}" for each in described[:SHOWN])
        shown += f"\n    and {len(described) - SHOWN} more" * (len(described) > SHOWN)
        present = ", ".join(
            f"{each} 0x{each.identity.vendor:08X}:0x{each.identity.product:08X}"
            for each in devices[:SHOWN]
        )
        raise EsiLookupError(
            f"describes none of the devices on the segment, which are {present}; it "
            + (f"describes{shown}" if described else "has no devices"),
            file=str(self._library.path),
            candidates=tuple(described),
            hint="use the ESI files of these devices, or omit esi=",
        )


def open_source(place: EsiPlace) -> EsiSource | None:
    """Return the ESI files of a scan; None without any.

    Args:
        place: File or folder, or a library. None: the library of the user if it exists. False:
            no ESI files.

    Raises:
        EsiError: A given file, folder or library cannot be read.
    """
    if place is False or (place is None and not default_folder().is_dir()):
        return None
    from catenary.esi.library import Library

    if place is None:
        return EsiSource(Library(), given=False)
    library = place if isinstance(place, Library) else Library.of(place)
    return EsiSource(library, given=True)


def unchanged(device: DeviceDescription) -> DeviceDescription:
    """Return the description as it is: the completion of a scan without ESI files."""
    return device


def _noted(device: DeviceDescription, *notes: str) -> DeviceDescription:
    return replace(device, notes=(*device.notes, *notes))
