"""Stream: set-points written ahead of their cycles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from catenary import core
from catenary.plan.request import Views

Rows = npt.ArrayLike


class Stream:
    """Set-points written ahead, one row per cycle. The cycle thread consumes them in order.

    From the first row until `close`, the stream sets the targets. A law that runs at the same time
    reads the row in its targets. An empty stream is an underrun: the axes decelerate (in CST, they
    keep their torque), and are stopped after the late limit. During an underrun, `cycle.dry` is
    True and `dry` counts the cycles. The next row ends it. Any thread may write, but only one at a
    time. An axis that is enabled later follows only the rows that are written after it was enabled.
    """

    def __init__(self, engine: core.Engine, views: Views, capacity: int) -> None:
        self._engine = engine
        self._views = views
        self._axes = len(views.actual_position)
        self._ring = core.Stream(self._axes, capacity)
        engine.set_stream(self._ring)

    def write(
        self,
        position: Rows | None = None,
        *,
        velocity: Rows | None = None,
        torque: Rows | None = None,
    ) -> int:
        """Write rows of set-points, each (k, n), or (n,) for one row.

        Args:
            position: Positions [rad]; None: the present target positions.
            velocity: Velocities [rad/s]; None: zero.
            torque: Torques [N·m]; None: zero.

        Returns:
            Number of rows that were written. The remaining rows did not fit.

        Raises:
            ValueError: No quantity is given, the shapes differ, or a value is NaN or infinite.
        """
        rows = {
            name: self._checked(name, values)
            for name, values in (("position", position), ("velocity", velocity), ("torque", torque))
            if values is not None
        }
        counts = {len(values) for values in rows.values()}
        if len(counts) != 1:
            raise ValueError(
                f"give the same number of rows of each quantity, not {sorted(counts) or 'none'}"
            )
        [count] = counts
        block = np.zeros((count, 3, self._axes))
        block[:, 0] = self._views.target_position
        for k, name in enumerate(("position", "velocity", "torque")):
            if name in rows:
                block[:, k] = rows[name]
        return self._ring.write(block.tobytes(), self._engine.number)

    def _checked(self, name: str, values: Rows) -> npt.NDArray[np.float64]:
        array = np.atleast_2d(np.asarray(values, dtype=np.float64))
        if array.ndim != 2 or array.shape[1] != self._axes:
            raise ValueError(
                f"{name}: must be rows of {self._axes} axes, not of shape {array.shape}"
            )
        if not np.isfinite(array).all():
            raise ValueError(f"{name}: contains NaN or infinity; set-points must be finite")
        return array

    @property
    def waiting(self) -> int:
        """Number of rows that were written and not yet consumed."""
        return self._ring.waiting

    @property
    def taken(self) -> int:
        """Number of rows that the cycle thread has consumed."""
        return self._ring.taken

    @property
    def free(self) -> int:
        """Number of rows that can be written now."""
        return self._ring.capacity - self._ring.waiting

    @property
    def dry(self) -> int:
        """Number of cycles without a row since the first one was consumed."""
        return self._ring.dry

    def close(self) -> None:
        """Return control to the application or the law, and discard the remaining rows.

        Until the next commit, CSP and CSV decelerate and hold. CST keeps its torque for `handover`.
        """
        self._engine.set_stream(None)
