"""CDR of messages whose size never changes: laid out once, then encoded by NumPy for all rows of a
batch together.

OMG DDS-XTypes 1.3 §7.4.3, version 1 (what ROS 2 writes): little endian, every primitive aligned to
its own size, counted from behind the four bytes of encapsulation. Strings count their final zero;
a sequence is its length and its elements; an array has no length.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR_LE, no options: DDSI-RTPS 2.3 §10.2
Rows = npt.NDArray[np.void]


@dataclass(frozen=True, slots=True)
class CdrMessage:
    """One kind of message. `constant` are its bytes with every field zero; `dtype` places the
    fields in them."""

    dtype: np.dtype[np.void]
    constant: bytes

    def encode(self, columns: Mapping[str, npt.NDArray[Any]], count: int) -> bytes:
        """`count` messages, one behind the other; of each column one value per message."""
        out = np.frombuffer(bytearray(self.constant * count), self.dtype)
        for name, values in columns.items():
            out[name] = values
        return out.tobytes()

    def decode(self, messages: bytes) -> Rows:
        """The fields of messages, one behind the other."""
        return np.frombuffer(messages, self.dtype)


class CdrLayout:
    """Owns the layout of a message while fields are added to it, in their order."""

    def __init__(self) -> None:
        self._constant = bytearray(ENCAPSULATION)
        self._names: list[str] = []
        self._formats: list[tuple[str, tuple[int, ...]]] = []
        self._offsets: list[int] = []

    def field(self, name: str, dtype: str, shape: tuple[int, ...] = ()) -> None:
        """A primitive, or an array of them."""
        size = np.dtype(dtype).itemsize
        self._align(size)
        self._names.append(name)
        self._formats.append((dtype, shape))
        self._offsets.append(len(self._constant))
        self._constant += bytes(size * prod(shape))

    def sequence(self, name: str, dtype: str, length: int) -> None:
        """A sequence that always has as many elements."""
        self._count(length)
        if length:
            self.field(name, dtype, (length,))

    def text(self, value: str) -> None:
        """A string that is always the same."""
        coded = value.encode() + b"\0"
        self._count(len(coded))
        self._constant += coded

    def texts(self, values: Sequence[str]) -> None:
        """A sequence of strings that are always the same."""
        self._count(len(values))
        for value in values:
            self.text(value)

    def make(self) -> CdrMessage:
        dtype = np.dtype(
            {
                "names": self._names,
                "formats": self._formats,
                "offsets": self._offsets,
                "itemsize": len(self._constant),
            }
        )
        return CdrMessage(dtype, bytes(self._constant))

    def _count(self, length: int) -> None:
        self._align(4)
        self._constant += length.to_bytes(4, "little")

    def _align(self, size: int) -> None:
        self._constant += bytes(-(len(self._constant) - len(ENCAPSULATION)) % size)
