"""StartUp: an object that the application has written to a device before SAFE-OP."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import cast

from catenary.types import DataType, Scalar, Value


@dataclass(frozen=True, slots=True)
class StartUp:
    """An object that is written to a device in PRE-OP, each time the loop starts it.

    It is written again when the device returns after a loss.

    Args:
        index: Of the object, 0 to 0xFFFF.
        subindex: 0 to 0xFF.
        value: In the unit of the device; bytes are sent as they are.
        type: Of `catenary.types`. None: from the device's object dictionary.
        before_mapping: Write it before the PDO mapping; else after it.
        verify: Read it back and compare. Objects that can only be written are not read.

    Raises:
        ValueError: The index, the subindex or the value is out of range.
        TypeError: The value does not agree with the type.
    """

    index: int
    subindex: int
    value: Value
    _: KW_ONLY
    type: Scalar | None = None
    before_mapping: bool = False
    verify: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.index <= 0xFFFF or not 0 <= self.subindex <= 0xFF:
            raise ValueError(f"start-up object {self.place}: an index has 16 bits, a subindex 8")
        if self.type is not None:
            self.encode(self.type)

    @property
    def place(self) -> str:
        """Index and subindex as text."""
        return f"0x{self.index:04X}:{self.subindex:02X}"

    @property
    def needs_type(self) -> bool:
        """True if the type must come from the dictionary."""
        return self.type is None and not isinstance(self.value, bytes)

    def encode(self, kind: Scalar | None) -> bytes:
        """Return the bytes that are sent. `kind`: None for bytes without a type."""
        if kind is None or (self.type is None and isinstance(self.value, bytes)):
            if not isinstance(self.value, bytes):
                raise TypeError(f"start-up object {self.place}: {self.value!r} needs a type")
            return self.value
        try:
            return cast(DataType[Value], kind).encode(self.value)
        except (TypeError, ValueError, AttributeError) as error:
            kind_of = TypeError if isinstance(error, AttributeError) else type(error)
            raise kind_of(
                f"start-up object {self.place}: {self.value!r} is not a value of {kind}: {error}"
            ) from None

    def text(self, kind: Scalar | None) -> str:
        """Return the value with its type, as a plan shows it."""
        if isinstance(self.value, bytes):
            return self.value.hex(" ")
        return f"{self.value!r} ({kind})"
