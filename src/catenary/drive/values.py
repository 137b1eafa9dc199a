"""Arrays of a process-data request, which are views of the buffers of the open loop."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from catenary.drive.attributes import unknown_attribute
from catenary.plan.request import Modes, Reals

QUANTITIES = ("position", "velocity", "torque", "mode")
Array = npt.NDArray[np.float64] | npt.NDArray[np.int64]


class AxisValues:
    """Quantities of n axes, one array each.

    The arrays stay the same objects while the loop is open. Write targets with `[:] =`, and keep
    values with `.copy()`.
    """

    __slots__ = ("_columns", "_owner", "mode", "position", "torque", "velocity")

    position: Reals  # (n,) [rad or m]
    velocity: Reals  # (n,) [rad/s or m/s]
    torque: Reals  # (n,) [N·m or N]
    mode: Modes  # (n,) modes of operation: 1 PP, 3 PV, 6 HM, 8 CSP, 9 CSV, 10 CST

    _owner: str
    _columns: Mapping[str, Array]

    def __init__(self, owner: str) -> None:
        object.__setattr__(self, "_owner", owner)

    def bind(
        self,
        position: Reals,
        velocity: Reals,
        torque: Reals,
        mode: Modes,
        columns: Mapping[str, Array],
    ) -> None:
        """Point the attributes at the arrays of a newly opened loop.

        Args:
            position: (n,) [rad or m].
            velocity: (n,) [rad/s or m/s].
            torque: (n,) [N·m or N].
            mode: (n,) modes of operation.
            columns: further arrays by name.
        """
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "velocity", velocity)
        object.__setattr__(self, "torque", torque)
        object.__setattr__(self, "mode", mode)
        object.__setattr__(self, "_columns", columns)

    @property
    def columns(self) -> Mapping[str, Array]:
        """Further arrays by name. Raises RuntimeError if no loop has been opened yet."""
        if not hasattr(self, "_columns"):
            raise RuntimeError(f"{self._owner}.columns has no values before a Loop is open")
        return self._columns

    def __getitem__(self, name: str) -> Array:
        """Return a column (n,): float64 in SI units, or int64 for raw values.

        Raises:
            KeyError: The name is unknown.
            RuntimeError: No loop has been opened yet.
        """
        if not hasattr(self, "_columns"):
            raise RuntimeError(f"{self._owner}[{name!r}] has no values before a Loop is open")
        try:
            return self._columns[name]
        except KeyError:
            known = ", ".join(self._columns) or "none"
            raise KeyError(
                f"no column {name!r} in {self._owner}; columns requested with Drives(columns=...): "
                f"{known}"
            ) from None

    def __setitem__(self, name: str, values: npt.ArrayLike) -> None:
        """Write a column: one value for all axes, or one per axis.

        Raises:
            KeyError: The name is unknown.
            RuntimeError: No loop has been opened yet.
            TypeError: The column is read-only.
        """
        array = self[name]
        if not array.flags.writeable:
            raise TypeError(f"{self._owner} values are read-only; write to target[...] instead")
        array[:] = values

    def __getattr__(self, name: str) -> object:
        # Python calls this only for a slot without a value, or for an unknown attribute.
        if name not in QUANTITIES:
            raise unknown_attribute(self, name, self._owner)
        raise AttributeError(f"{self._owner}.{name} has no values before a Loop is open")

    def __setattr__(self, name: str, value: object) -> None:
        if name not in QUANTITIES:
            raise unknown_attribute(self, name, self._owner)
        raise AttributeError(
            f"{self._owner}.{name} cannot be replaced; write into the array: "
            f"{self._owner}.{name}[:] = ..."
        )
