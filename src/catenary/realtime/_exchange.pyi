"""Values and queues between tasks, as bytes: neither side ever waits for the other."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from typing_extensions import Buffer

Array: TypeAlias = npt.NDArray[np.generic]

def value_size(size: int) -> int:
    """Bytes of memory for a value of `size` bytes."""

def queue_size(size: int, length: int) -> int:
    """Bytes of memory for a queue of `length` records of `size` bytes."""

class ValueCore:
    """A value in shared memory that was zeros at first; ValueError: bytes of another size."""

    writer: int
    def __init__(self, memory: Buffer, size: int) -> None: ...
    @property
    def number(self) -> int: ...
    def write(self, data: Array | bytes) -> None: ...
    def read(self, into: Array | bytearray) -> int:
        """The number of the value copied; -1: overwritten at every try."""

class QueueCore:
    """A queue in shared memory that was zeros at first; ValueError: bytes of another size."""

    producer: int
    consumer: int
    def __init__(self, memory: Buffer, size: int, length: int, overwrite: bool) -> None: ...
    @property
    def waiting(self) -> int: ...
    @property
    def refused(self) -> int: ...
    @property
    def lost(self) -> int: ...
    def put(self, data: Array | bytes) -> bool: ...
    def take(self, into: Array | bytearray) -> bool: ...
