"""Lists of modules in a modular device (ETG.5001): 0xF000, 0xF030 and 0xF050."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from catenary.virtual.coe.dictionary import (
    OUT_OF_RANGE,
    READ_ANY,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_PRE_OP,
    Abort,
    Dictionary,
    Entry,
    number,
)

PROFILE, CONFIGURED, DETECTED = 0xF000, 0xF030, 0xF050


class ModuleLists:
    """The configured idents of a device, which a MainDevice writes, and the detected ones.

    A device with other configured than detected modules refuses SAFE-OP.
    """

    def __init__(self, slots: int, detected: Sequence[int], configured: Sequence[int]) -> None:
        """Initialise the lists.

        Args:
            slots: Number of slots, at most 255.
            detected: Idents of the modules in the slots; 0 for an empty slot.
            configured: Idents in 0xF030 at power-up.
        """
        self.detected = _padded(detected, slots)
        self.configured = _padded(configured, slots)
        self.count = slots

    @property
    def differ(self) -> bool:
        """True if the configured modules are not those that were detected."""
        valid = self.configured[: self.count]
        return valid + [0] * (len(self.detected) - len(valid)) != self.detected

    def add_to(self, dictionary: Dictionary, index_distance: int) -> None:
        """Add the objects to a dictionary. They replace those of the ESI.

        Args:
            dictionary: Dictionary of the device.
            index_distance: Increment of the object indices from slot to slot.
        """
        slots = len(self.detected)
        if PROFILE not in dictionary.objects:
            facts = [
                number("Index distance", UNSIGNED16, index_distance),
                number("Maximum number of modules", UNSIGNED16, slots),
            ]
            dictionary.add_record(PROFILE, "Modular device profile", facts)
        found = [
            number(f"SubIndex {k:03d}", UNSIGNED32, ident)
            for k, ident in enumerate(self.detected, start=1)
        ]
        dictionary.add_record(DETECTED, "Detected module ident list", found)
        dictionary.add(CONFIGURED, "Configured module ident list", self._configured())

    def _configured(self) -> dict[int, Entry]:
        access = READ_ANY | WRITE_PRE_OP
        count = Entry(
            "SubIndex 000", UNSIGNED8, 8, access, lambda: bytes([self.count]), self._set_count
        )
        return {0: count} | {k + 1: self._entry(k, access) for k in range(len(self.detected))}

    def _entry(self, slot: int, access: int) -> Entry:
        def read() -> bytes:
            return struct.pack("<I", self.configured[slot])

        def write(data: bytes) -> None:
            self.configured[slot] = int.from_bytes(data, "little")

        return Entry(f"SubIndex {slot + 1:03d}", UNSIGNED32, 32, access, read, write)

    def _set_count(self, data: bytes) -> None:
        count = int.from_bytes(data, "little")
        if count > len(self.detected):
            raise Abort(OUT_OF_RANGE)
        self.count = count


def _padded(idents: Sequence[int], slots: int) -> list[int]:
    return [*idents, *[0] * slots][:slots]
