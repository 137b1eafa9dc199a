"""Layout of the rows of a recording. The file contains it, so that a reader needs nothing else."""

from __future__ import annotations

import msgspec
import numpy as np

TIME = "scheduled_ns"  # field with the cycle start time, on the clock of the loop
NUMBER = "number"  # field with the number of the cycle


class Field(msgspec.Struct, frozen=True):
    """A quantity that every cycle has. `dtype` is in NumPy notation (`<f8`)."""

    name: str
    dtype: str
    shape: tuple[int, ...] = ()
    unit: str = ""  # SI unit; empty for a number without a unit
    per_axis: bool = False  # True if the field has one number per axis


class Layout(msgspec.Struct, frozen=True):
    """Layout of the rows of one loop."""

    name: str
    period: float  # [s]
    axes: tuple[str, ...]
    fields: tuple[Field, ...]
    clock: str = "monotonic"  # clock of the times: "monotonic" or "virtual"
    utc_offset_ns: int = 0  # UTC minus that clock

    @property
    def dtype(self) -> np.dtype[np.void]:
        """NumPy type of a row."""
        return np.dtype([(field.name, field.dtype, field.shape) for field in self.fields])

    def field(self, name: str) -> Field | None:
        """Return the field with this name; None if the layout does not contain it."""
        return next((field for field in self.fields if field.name == name), None)

    def of_axes(self, name: str) -> bool:
        """Return True if the layout has this field, with one float64 per axis."""
        field = self.field(name)
        return field is not None and field.per_axis and np.dtype(field.dtype) == np.float64
