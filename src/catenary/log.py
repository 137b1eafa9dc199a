"""The log of a loop: its last cycles as an array, a pandas table or a CSV file."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pandas

Rows: TypeAlias = npt.NDArray[np.void]

TIME = "time"
INDEX = "time [s]"
AXIS_POSITION = ".actual.position"
CHUNK = 4096  # rows per write


class Log:
    """The last cycles of a loop, oldest first: `log["lateness_ns"]`, `log[-1]`, `log[-100:]`.

    `numpy.asarray(log)` returns a structured array, shape (cycles,). `time` [s] has the same zero
    as `cycle.time`, so it is negative before the first iteration. With `Loop(log_axes=True)`, each
    axis has its own fields, such as `shoulder.actual.position`. docs/how_to/recording.md lists all
    fields.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows = rows

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Structured type of the cycles; `log.dtype.names` lists the fields."""
        return self._rows.dtype

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the logged axes; empty without `log_axes`."""
        names = self._rows.dtype.names or ()
        return tuple(n.removesuffix(AXIS_POSITION) for n in names if n.endswith(AXIS_POSITION))

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self._rows)

    @overload
    def __getitem__(self, key: str) -> npt.NDArray[Any]: ...
    @overload
    def __getitem__(self, key: int) -> np.void: ...
    @overload
    def __getitem__(
        self, key: slice | Sequence[int] | npt.NDArray[np.bool_] | npt.NDArray[np.integer[Any]]
    ) -> Log: ...
    def __getitem__(
        self,
        key: str
        | int
        | slice
        | Sequence[int]
        | npt.NDArray[np.bool_]
        | npt.NDArray[np.integer[Any]],
    ) -> npt.NDArray[Any] | np.void | Log:
        """Return a field for a name, shape (cycles,); one cycle for an index; a Log for a slice.

        A list of indices or a mask also returns a Log.

        Raises:
            ValueError: The field does not exist.
            IndexError: The cycle does not exist.
        """
        found = self._rows[key]
        if isinstance(key, str) or not isinstance(found, np.ndarray):
            return found
        return Log(found)

    def __array__(
        self, dtype: np.dtype[Any] | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        rows = self._rows if dtype is None else self._rows.astype(dtype)
        return rows.copy() if copy else rows

    def __repr__(self) -> str:
        if not len(self):
            return "Log(0 cycles)"
        time = self._rows[TIME]
        axes = f", {len(self.axes)} axes" if self.axes else ""
        return f"Log({len(self)} cycles, {time[0]:.6g} to {time[-1]:.6g} s{axes})"

    def to_pandas(self) -> pandas.DataFrame:
        """Return the cycles as a pandas table: index time [s], one column for each field.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError(
                "Log.to_pandas needs pandas: pip install pandas; "
                "to_csv and numpy.asarray(log) work without it",
                name="pandas",
            ) from error
        names = [name for name in self._rows.dtype.names or () if name != TIME]
        index = pandas.Index(self._rows[TIME], name=INDEX)
        return pandas.DataFrame({name: self._rows[name] for name in names}, index=index)

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV file with the names of the fields in its first line.

        An unknown value is `nan`. `catenary plot FILE.csv` draws the file.

        Raises:
            OSError: The file cannot be written.
        """
        with open(path, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(self._rows.dtype.names or ())
            for start in range(0, len(self), CHUNK):
                writer.writerows(self._rows[start : start + CHUNK].tolist())
