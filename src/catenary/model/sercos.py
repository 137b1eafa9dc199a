"""Description of one SERCOS parameter: the elements of an IDN in displayed numbers."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.wire.sercos import Attribute, CommandState, Protection, idn_text
from catenary.wire.sercos_values import Value


@dataclass(frozen=True, slots=True)
class Parameter:
    """Elements of an IDN. An element that the drive does not have is None, or an empty text.

    Numbers are displayed ones: the decimals of the attribute are applied.
    """

    number: int  # 16 bits
    attribute: Attribute
    name: str = ""
    unit: str = ""
    minimum: Value | None = None
    maximum: Value | None = None
    value: Value | None = None
    default: Value | None = None
    state: CommandState | None = None  # of a procedure command
    list_limit: int | None = None  # maximum length of a list [bytes]
    drive: int = 0

    @property
    def idn(self) -> str:
        """Notation, such as "S-0-0047"."""
        return idn_text(self.number)

    @property
    def protected_in(self) -> tuple[str, ...]:
        """States in which the value is write-protected: "PRE_OP", "SAFE_OP", "OP"."""
        states = (Protection.PRE_OP, Protection.SAFE_OP, Protection.OP)
        return tuple(each.name or "" for each in states if each in self.attribute.protection)

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.idn} {self.name}: {self.value}{unit}"
