"""StartUp: a value that the application writes to an object of a device before SAFE-OP."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import cast

from catenary.types import DataType, Scalar, Value

# ETG.1000.6 §5.6.7.4: RxPDOs, TxPDOs, and their assignment to SyncManagers
MAPPING_OBJECTS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00), range(0x1C10, 0x1C30))


@dataclass(frozen=True, slots=True)
class StartUp:
    """Value of an object that a loop writes to a device in PRE-OP, each time the loop starts.

    The loop writes it again when the device returns after a loss.

    Args:
        index: Index of the object, 0 to 0xFFFF.
        subindex: Subindex, 0 to 0xFF.
        value: Value in the unit of the device. Bytes are sent unchanged.
        type: A type of `catenary.types`. None uses the type in the device's object dictionary.
        before_mapping: True to write the value before the PDO mapping; False to write it after.
        verify: True to read the value back and compare it. Write-only objects are not read.
        complete_access: True to write all subindices from `subindex` on (0 or 1) with one
            request. `value` then has the bytes of all of them, and is not read back.

    Raises:
        ValueError: The index, the subindex or the value is out of range, or the object belongs to
            the PDO mapping.
        TypeError: The value does not agree with the type, `type` is not a type, or an index is
            text.
    """

    index: int
    subindex: int
    value: Value
    _: KW_ONLY
    type: Scalar | None = None
    before_mapping: bool = False
    verify: bool = True
    complete_access: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.index, str) or isinstance(self.subindex, str):
            raise TypeError(
                f"start-up object: index and subindex must be numbers, not {self.index!r} and "
                f"{self.subindex!r}"
            )
        if not 0 <= self.index <= 0xFFFF or not 0 <= self.subindex <= 0xFF:
            raise ValueError(f"start-up object {self.place}: an index has 16 bits, a subindex 8")
        if any(self.index in objects for objects in MAPPING_OBJECTS):
            # Unknown to the plan, this mapping would let wrong bytes reach controlword and targets.
            raise ValueError(
                f"start-up object {self.place} is part of the PDO mapping; write the mapping with "
                "pdos= of the request"
            )
        if self.complete_access:
            self._check_complete_access()
        if self.type is None:
            return
        if not isinstance(self.type, DataType):
            raise TypeError(
                f"start-up object {self.place}: {self.type!r} is not a type of catenary.types, "
                "such as types.UDINT"
            )
        self.encode(self.type)

    def _check_complete_access(self) -> None:
        if self.subindex > 1:
            raise ValueError(
                f"start-up object {self.place}: complete access begins at subindex 0 or 1"
            )
        if not isinstance(self.value, bytes):
            raise TypeError(
                f"start-up object {self.place}: complete access needs the bytes of all subindices"
            )

    @property
    def place(self) -> str:
        """Index and subindex as text."""
        return f"0x{self.index:04X}:{self.subindex:02X}"

    @property
    def needs_type(self) -> bool:
        """True if the type must come from the object dictionary."""
        return self.type is None and not isinstance(self.value, bytes)

    def encode(self, kind: Scalar | None) -> bytes:
        """Return the bytes to send. `kind` is the type of the value; None for untyped bytes.

        Raises:
            ValueError: The value is out of range.
            TypeError: The value does not agree with the type, or needs one.
        """
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
