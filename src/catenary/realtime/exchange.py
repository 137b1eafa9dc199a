"""Wait-free values and queues between tasks, in threads or processes.

A `Value` passes the latest array from one writer to any number of readers. A `Queue` passes every
record from one producer to one consumer. Both hold NumPy arrays of a fixed type and shape. Create
them before the tasks start, and pass them as arguments.
"""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING, Literal, TypeAlias

from catenary.realtime._exchange import QueueCore, ValueCore, queue_size, value_size
from catenary.realtime.system.memory import SharedMemory

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Array: TypeAlias = npt.NDArray[np.generic]

Full: TypeAlias = Literal["refuse", "overwrite"]


class Form:
    """Type and shape of the exchanged arrays."""

    def __init__(self, dtype: npt.DTypeLike, shape: int | tuple[int, ...]) -> None:
        import numpy as np

        self.dtype = np.dtype(dtype)
        self.shape = (shape,) if isinstance(shape, int) else tuple(shape)
        if self.dtype.hasobject:
            raise TypeError(f"{self.dtype} holds Python objects, which processes cannot share")
        self.size = int(self.dtype.itemsize * np.prod(self.shape, dtype=int))
        if self.size <= 0:
            raise ValueError(f"{self} has a size of 0 bytes")

    def __reduce__(self) -> tuple[type[Form], tuple[npt.DTypeLike, tuple[int, ...]]]:
        return Form, (self.dtype, self.shape)

    def __str__(self) -> str:
        return f"{self.dtype} of shape {self.shape}"

    def conforming(self, data: npt.ArrayLike) -> Array:
        """Return `data` as an array of this form. Raises ValueError if it does not fit."""
        import numpy as np

        try:
            array = np.asarray(data, self.dtype, order="C")
        except (TypeError, ValueError) as error:
            raise ValueError(f"{data!r} does not fit {self}: {error}") from error
        if array.shape != self.shape:
            raise ValueError(f"received an array of shape {array.shape}, expected {self}")
        return array

    def empty(self) -> Array:
        import numpy as np

        return np.empty(self.shape, self.dtype)


class Value:
    """The latest array, passed from one writer to any number of readers.

    If a writer is killed during a write, the previous value remains, and a restarted writer can
    continue.
    """

    def __init__(self, dtype: npt.DTypeLike = "f8", shape: int | tuple[int, ...] = ()) -> None:
        """Allocate the value. It reads as zeros until the first write.

        Args:
            dtype: NumPy type; may be structured.
            shape: shape of the array.

        Raises:
            ValueError: the array has a size of 0 bytes.
            TypeError: `dtype` is not a NumPy type, or contains Python objects.
        """
        self._bind(Form(dtype, shape), None)

    def __getstate__(self) -> tuple[Form, SharedMemory]:
        return self._form, self._memory

    def __setstate__(self, state: tuple[Form, SharedMemory]) -> None:
        self._bind(*state)

    def _bind(self, form: Form, memory: SharedMemory | None) -> None:
        self._form = form
        self._memory = memory or SharedMemory(value_size(form.size))
        self._core = ValueCore(self._memory.buffer, form.size)
        self._writes = False

    @property
    def number(self) -> int:
        """Number of writes."""
        return self._core.number

    def write(self, data: npt.ArrayLike) -> None:
        """Publish an array. Readers never receive a partly written array.

        Raises:
            ValueError: the shape differs, or the data cannot be converted to the type.
            RuntimeError: another running thread writes this value.
        """
        if not self._writes:
            self._core.writer = claim("value", "writer", self._core.writer)
            self._writes = True
        self._core.write(self._form.conforming(data))

    def read(self) -> Array:
        """Return a consistent copy of the latest array.

        Raises RuntimeError if a write interfered with each of 1000 attempts.
        """
        array = self._form.empty()
        if self._core.read(array) < 0:
            raise RuntimeError(
                f"cannot read a value of {self._form.size} bytes, because a write interfered with "
                "each of 1000 attempts; write it less often"
            )
        return array


class Silence:
    """Counter of consecutive checks without a new value, to detect that the writer has ended."""

    def __init__(self, value: Value) -> None:
        self._value = value
        self._number = 0
        self._calls = 0

    def look(self) -> int:
        """Return the number of calls without a new value; 0 before the first value."""
        before, self._number = self._number, self._value.number
        self._calls = self._calls + 1 if before == self._number > 0 else 0
        return self._calls


class Queue:
    """A bounded queue of records, from one producer to one consumer.

    If a producer is killed during `put`, its record is not in the queue. If the queue was full and
    overwrites, the oldest record may be lost. If a consumer is killed during `take`, the record
    stays in the queue.
    """

    def __init__(
        self,
        dtype: npt.DTypeLike = "f8",
        shape: int | tuple[int, ...] = (),
        *,
        length: int,
        full: Full = "refuse",
    ) -> None:
        """Allocate the queue.

        Args:
            dtype: NumPy type of a record; may be structured.
            shape: shape of a record.
            length: capacity in records.
            full: effect of `put` on a full queue: "refuse" the record or "overwrite" the oldest.

        Raises:
            ValueError: a record has a size of 0 bytes, or `length` or `full` is invalid.
            TypeError: `dtype` is not a NumPy type, or contains Python objects.
        """
        if not 0 < length < 2**31:
            raise ValueError(f"a length of {length} records is not within 1 to 2**31 - 1")
        if full not in ("refuse", "overwrite"):
            raise ValueError(f'full must be "refuse" or "overwrite", not {full!r}')
        self._bind(Form(dtype, shape), length, full, None)

    def __getstate__(self) -> tuple[Form, int, Full, SharedMemory]:
        return self._form, self._length, self._full, self._memory

    def __setstate__(self, state: tuple[Form, int, Full, SharedMemory]) -> None:
        self._bind(*state)

    def _bind(self, form: Form, length: int, full: Full, memory: SharedMemory | None) -> None:
        self._form, self._length, self._full = form, length, full
        self._memory = memory or SharedMemory(queue_size(form.size, length))
        self._core = QueueCore(self._memory.buffer, form.size, length, full == "overwrite")
        self._produces = self._consumes = False

    def __len__(self) -> int:
        """Return the number of records that can be taken."""
        return self._core.waiting

    @property
    def refused(self) -> int:
        """Number of records that `put` refused."""
        return self._core.refused

    @property
    def lost(self) -> int:
        """Number of overwritten records that the consumer has noticed."""
        return self._core.lost

    def put(self, record: npt.ArrayLike) -> bool:
        """Append a record. Return False if the queue is full and refuses the record.

        Raises:
            ValueError: the shape differs, or the record cannot be converted to the type.
            RuntimeError: another running thread is the producer.
        """
        if not self._produces:
            self._core.producer = claim("queue", "producer", self._core.producer)
            self._produces = True
        return self._core.put(self._form.conforming(record))

    def take(self) -> Array | None:
        """Remove and return the oldest record; None if the queue is empty.

        Also return None if records are overwritten faster than they can be copied.
        Raises RuntimeError if another running thread is the consumer.
        """
        if not self._consumes:
            self._core.consumer = claim("queue", "consumer", self._core.consumer)
            self._consumes = True
        array = self._form.empty()
        return array if self._core.take(array) else None


def claim(what: str, role: str, holder: int) -> int:
    """Return the id of the calling thread.

    Raises RuntimeError if another thread that still runs has the role.
    """
    thread = threading.get_native_id()
    if holder not in (0, thread) and os.path.exists(f"/proc/{holder}"):
        raise RuntimeError(
            f"this {what} already has a {role}: thread {holder}. Only one thread can have this role"
        )
    return thread
