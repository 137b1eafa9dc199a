"""The two sides of a comparison: one device in the earlier and in the present clone."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.line.change import (
    Change,
    ChangedDevice,
    ChangedEntry,
    Part,
    Severity,
    Uncompared,
)
from catenary.line.values import ClonedDevice


@dataclass(frozen=True, slots=True)
class Sides:
    """One device in both clones."""

    old: ClonedDevice
    new: ClonedDevice
    serials: bool = True  # False if a clone has no serial numbers

    @property
    def device(self) -> ChangedDevice:
        """Name and positions."""
        return ChangedDevice(self.new.name, self.old.position, self.new.position)

    @property
    def exchanged(self) -> bool:
        """True if the serial number shows another device."""
        old, new = self.old.identity, self.new.identity
        return self.serials and old is not None and new is not None and old.serial != new.serial

    def change(
        self,
        part: Part,
        what: str,
        values: tuple[str, str],
        severity: Severity = Severity.EFFECT,
        note: str = "",
        entry: ChangedEntry | None = None,
    ) -> Change:
        """Return a change of this device.

        Args:
            part: Part of the device.
            what: Name of the value.
            values: The earlier and the present value as text.
            severity: Effect of the change.
            note: Meaning of the change.
            entry: Entry of the dictionary, for values of objects.
        """
        return Change(self.device, part, what, *values, severity, note, entry)

    def uncompared(self, part: str, reason: str, *, expected: bool) -> Uncompared:
        """Return a part that was not compared.

        Args:
            part: Name of the part.
            reason: The reason.
            expected: True if the earlier clone has this part.
        """
        return Uncompared(self.device, part, reason, expected)
