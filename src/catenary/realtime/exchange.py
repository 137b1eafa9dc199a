"""Values and queues between tasks, in threads or processes: neither side ever waits for the other.

A `Value` is the latest of something, from one writer to any number of readers. A `Queue` is every
record of something, from one producer to one consumer. Both are made before the tasks start and
handed to them as arguments; they hold NumPy arrays of one type and shape.
"""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING, Literal, TypeAlias

from catenary.realtime._exchange import QueueCore, ValueCore, queue_size, value_size
from catenary.realtime.memory import SharedMemory

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Array: TypeAlias = npt.NDArray[np.generic]

Full: TypeAlias = Literal["refuse", "overwrite"]


class Form:
    """The type and shape of what is exchanged; checks arrays."""

    def __init__(self, dtype: npt.DTypeLike, shape: int | tuple[int, ...]) -> None:
        import numpy as np

        self.dtype = np.dtype(dtype)
        self.shape = (shape,) if isinstance(shape, int) else tuple(shape)
        if self.dtype.hasobject:
            raise TypeError(f"{self.dtype} holds Python objects, which other processes cannot see")
        self.size = int(self.dtype.itemsize * np.prod(self.shape, dtype=int))
        if self.size <= 0:
            raise ValueError(f"{self} has no bytes")

    def __reduce__(self) -> tuple[type[Form], tuple[npt.DTypeLike, tuple[int, ...]]]:
        return Form, (self.dtype, self.shape)

    def __str__(self) -> str:
        return f"{self.dtype} of shape {self.shape}"

    def conforming(self, data: npt.ArrayLike) -> Array:
        """As an array of this form. ValueError: of another shape, or not such numbers."""
        import numpy as np

        try:
            array = np.asarray(data, self.dtype, order="C")
        except (TypeError, ValueError) as error:
            raise ValueError(f"{data!r} is no {self}: {error}") from error
        if array.shape != self.shape:
            raise ValueError(f"an array of shape {array.shape} is given, {self} is expected")
        return array

    def empty(self) -> Array:
        import numpy as np

        return np.empty(self.shape, self.dtype)


class Value:
    """Owns the latest array of one writer, for any number of readers. A writer that is killed in
    mid-write leaves the value before; the task that replaces it goes on writing."""

    def __init__(self, dtype: npt.DTypeLike = "f8", shape: int | tuple[int, ...] = ()) -> None:
        """`dtype` may be structured. Zeros until the first write. ValueError: no bytes."""
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
        """How many were written."""
        return self._core.number

    def write(self, data: npt.ArrayLike) -> None:
        """Publishes an array, whole. ValueError: another shape. RuntimeError: another thread that
        lives writes this value."""
        if not self._writes:
            self._core.writer = claim("value", "writer", self._core.writer)
            self._writes = True
        self._core.write(self._form.conforming(data))

    def read(self) -> Array:
        """A copy of the latest one, whole. RuntimeError: it is written faster than it can be read,
        1000 times over."""
        array = self._form.empty()
        if self._core.read(array) < 0:
            raise RuntimeError(f"a value of {self._form.size} bytes is written too fast to be read")
        return array


class Silence:
    """Counts how often a periodic reader finds nothing new in a value: its writer may be gone."""

    def __init__(self, value: Value) -> None:
        self._value = value
        self._number = 0
        self._looks = 0

    def look(self) -> int:
        """Looks since the last that found a new value; 0 before the first value."""
        before, self._number = self._number, self._value.number
        self._looks = self._looks + 1 if before == self._number > 0 else 0
        return self._looks


class Queue:
    """Owns a bounded row of records, from one producer to one consumer. A producer that is killed
    in mid-put leaves no record; a consumer that is killed in mid-take finds its record again."""

    def __init__(
        self,
        dtype: npt.DTypeLike = "f8",
        shape: int | tuple[int, ...] = (),
        *,
        length: int,
        full: Full = "refuse",
    ) -> None:
        """`length` records at most. When they are there, `put` refuses the newest, or overwrites
        the oldest. ValueError: no records or no bytes."""
        if not 0 < length < 2**31:
            raise ValueError(f"a length of {length} records is not positive, or too much")
        if full not in ("refuse", "overwrite"):
            raise ValueError(f'full is "refuse" or "overwrite", not {full!r}')
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
        """Records that wait to be taken."""
        return self._core.waiting

    @property
    def refused(self) -> int:
        """Records that `put` did not take."""
        return self._core.refused

    @property
    def lost(self) -> int:
        """Records that were overwritten before they were taken, as far as the consumer has seen."""
        return self._core.lost

    def put(self, record: npt.ArrayLike) -> bool:
        """False: the queue is full, the record is refused and counted. ValueError: another shape.
        RuntimeError: another thread that lives puts into this queue."""
        if not self._produces:
            self._core.producer = claim("queue", "producer", self._core.producer)
            self._produces = True
        return self._core.put(self._form.conforming(record))

    def take(self) -> Array | None:
        """The oldest record; None: there is none. RuntimeError: another thread that lives takes
        from this queue."""
        if not self._consumes:
            self._core.consumer = claim("queue", "consumer", self._core.consumer)
            self._consumes = True
        array = self._form.empty()
        return array if self._core.take(array) else None


def claim(what: str, role: str, holder: int) -> int:
    """The calling thread, which takes a role that nobody has who lives."""
    me = threading.get_native_id()
    if holder not in (0, me) and os.path.exists(f"/proc/{holder}"):
        raise RuntimeError(f"this {what} has a {role} already, thread {holder}: it takes one only")
    return me
