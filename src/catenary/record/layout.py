"""Layout of a recording's rows; stored in the file, so that a reader needs nothing else."""

from __future__ import annotations

import msgspec
import numpy as np

TIME = "scheduled_ns"  # field with the time of a cycle: its cycle start, on the loop's clock
NUMBER = "number"


class Field(msgspec.Struct, frozen=True):
    """One quantity of every cycle. `dtype`: NumPy's notation (`<f8`); `unit`: SI, or empty."""

    name: str
    dtype: str
    shape: tuple[int, ...] = ()
    unit: str = ""
    per_axis: bool = False  # one number for each of the layout's axes


class Layout(msgspec.Struct, frozen=True):
    """Layout of the rows of one loop."""

    name: str
    period: float  # [s]
    axes: tuple[str, ...]
    fields: tuple[Field, ...]
    clock: str = "monotonic"  # in which the rows' times count: this machine's, or "virtual"
    utc_offset_ns: int = 0  # UTC less that clock

    @property
    def dtype(self) -> np.dtype[np.void]:
        return np.dtype([(field.name, field.dtype, field.shape) for field in self.fields])

    def field(self, name: str) -> Field | None:
        return next((field for field in self.fields if field.name == name), None)

    def of_axes(self, name: str) -> bool:
        """Return True if there is such a field, with one float64 for each axis."""
        field = self.field(name)
        return field is not None and field.per_axis and np.dtype(field.dtype) == np.float64
