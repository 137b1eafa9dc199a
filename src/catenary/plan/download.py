"""One SDO download of a plan."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.model.device import Entry


@dataclass(frozen=True, slots=True)
class Download:
    """One SDO download. `entry` is the entry that it maps, if any, for error messages."""

    index: int
    subindex: int
    data: bytes
    entry: Entry | None = None
    optional: bool = False  # True to ignore an absent or read-only object, or a refused value
    verify: bool = False  # read back and compared, unless it is write-only
    text: str = ""  # value as the application gave it; empty for objects of Catenary and the ESI
    complete_access: bool = False  # writes all subindices from `subindex` on
    source: str = ""  # file, line and comment of a command of the ESI or ENI
    origin: str = "ESI"  # or "ENI"

    @property
    def place(self) -> str:
        """Index and subindex as text."""
        return f"0x{self.index:04X}:{self.subindex:02X}"
