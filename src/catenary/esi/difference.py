"""Differences between a device and its ESI."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from catenary.esi.source import Source


class Severity(StrEnum):
    """Effect of a difference.

    An error keeps the device from OP, or changes the meaning of its process data. Vendors' files
    and devices often differ in other facts, which are warnings.
    """

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"


class Subject(StrEnum):
    """Part of the description that differs."""

    IDENTITY = "identity"
    CONFIGURATION = "configuration"  # ConfigData and size of the EEPROM
    MAILBOX = "mailbox"
    SYNC_MANAGER = "SyncManager"
    FMMU = "FMMU"
    PDO = "PDO"
    CLOCK = "clock"
    CAPABILITY = "capability"
    OBJECT = "object"


class Sides(NamedTuple):
    """Values of one fact as text. None marks a source that does not give the fact."""

    esi: str | None
    sii: str | None = None
    coe: str | None = None  # object dictionary, or behaviour of the mailbox

    @property
    def differ(self) -> bool:
        """True if two sources give different values."""
        return len({value for value in self if value is not None}) > 1


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference between a device and its ESI."""

    severity: Severity
    subject: Subject
    what: str  # the fact that differs, such as "SyncManager 2, start"
    sides: Sides
    source: Source  # of the ESI's value
    reason: str = ""  # why it matters
    advice: str = ""  # next step

    @property
    def device(self) -> str | None:
        """Value of the device: that of its object dictionary, otherwise that of its SII."""
        return self.sides.sii if self.sides.coe is None else self.sides.coe

    @property
    def follows(self) -> str:
        """Side that the device follows: "SII", "ESI", "both" or "neither"; empty if unknown."""
        esi, sii, coe = self.sides
        if coe is None:
            return ""
        if coe == esi:
            return "both" if sii == esi else "ESI"
        return "SII" if coe == sii else "neither"

    def __str__(self) -> str:
        text = f"{self.what}: {_values(self.sides)} ({self.source})"
        after = {"SII": "the device follows its SII", "ESI": "the device follows the ESI"}
        return "; ".join(each for each in (text, after.get(self.follows, "")) if each)


def _values(sides: Sides) -> str:
    """Return the values with their sources. Equal values are named once."""
    esi, sii, coe = sides
    given = [("the device", sii), ("the ESI", esi)]
    if coe not in (None, sii):
        given = [("the device", coe), ("its SII", sii), ("the ESI", esi)]
    sources: dict[str, list[str]] = {}
    for source, value in given:
        if value is not None:
            sources.setdefault(value, []).append(source)
    return ", ".join(f"{value} in {' and '.join(names)}" for value, names in sources.items())
