"""Wait-free values and queues of bytes between tasks."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from typing_extensions import Buffer

Array: TypeAlias = npt.NDArray[np.generic]

def value_size(size: int) -> int:
    """Return the memory size [bytes] for a value of `size` bytes."""

def queue_size(size: int, length: int) -> int:
    """Return the memory size [bytes] for a queue of `length` records of `size` bytes."""

class ValueCore:
    """Value in shared memory that starts as zeros. Raises ValueError for data of a wrong size."""

    writer: int
    def __init__(self, memory: Buffer, size: int) -> None: ...
    @property
    def number(self) -> int: ...
    def write(self, data: Array | bytes) -> None: ...
    def read(self, into: Array | bytearray) -> int:
        """Copy the value. Return its number, or -1 if a write interfered with every attempt."""

class QueueCore:
    """Queue in shared memory that starts as zeros. Raises ValueError for data of a wrong size."""

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
