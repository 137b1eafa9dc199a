"""CDR encoding of messages of constant size, so that NumPy encodes many rows in one step.

OMG DDS-XTypes 1.3 §7.4.3, version 1, as ROS 2 writes it. The encoding is little endian. Every
primitive is aligned to its own size; offsets count from the end of the 4-byte encapsulation header.
A string consists of its length (with the final zero) and its bytes. A sequence consists of its
length and its elements. An array has no length.
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
    """A message type: a template with all numbers zero, and the dtype with their offsets."""

    dtype: np.dtype[np.void]
    constant: bytes

    def encode(self, columns: Mapping[str, npt.NDArray[Any]], count: int) -> bytes:
        """Encode consecutive messages.

        Args:
            columns: values of each field, one per message.
            count: number of messages.

        Returns:
            Encoded messages, one after the other.
        """
        out = np.frombuffer(bytearray(self.constant * count), self.dtype)
        for name, values in columns.items():
            out[name] = values
        return out.tobytes()

    def decode(self, messages: bytes) -> Rows:
        """Return the fields of consecutive messages, one row per message."""
        return np.frombuffer(messages, self.dtype)


class CdrLayout:
    """Builder of a message type; fields are added in the order of the definition."""

    def __init__(self) -> None:
        self._constant = bytearray(ENCAPSULATION)
        self._names: list[str] = []
        self._formats: list[tuple[str, tuple[int, ...]]] = []
        self._offsets: list[int] = []

    def field(self, name: str, dtype: str, shape: tuple[int, ...] = ()) -> None:
        """Add a primitive, or an array of primitives.

        Args:
            name: name of the field.
            dtype: NumPy type of an element, such as "<f8".
            shape: shape of the array; () for a single primitive.
        """
        size = np.dtype(dtype).itemsize
        self._align(size)
        self._names.append(name)
        self._formats.append((dtype, shape))
        self._offsets.append(len(self._constant))
        self._constant += bytes(size * prod(shape))

    def sequence(self, name: str, dtype: str, length: int) -> None:
        """Add a sequence with a constant number of elements.

        Args:
            name: name of the field.
            dtype: NumPy type of an element, such as "<f8".
            length: number of elements.
        """
        self._count(length)
        if length:
            self.field(name, dtype, (length,))

    def text(self, value: str) -> None:
        """Add a constant string."""
        coded = value.encode() + b"\0"
        self._count(len(coded))
        self._constant += coded

    def texts(self, values: Sequence[str]) -> None:
        """Add a constant sequence of strings."""
        self._count(len(values))
        for value in values:
            self.text(value)

    def make(self) -> CdrMessage:
        """Return the message type."""
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
