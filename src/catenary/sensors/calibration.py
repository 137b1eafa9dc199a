"""Linear calibration of a sensor: values = matrix · (raw - bias)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Matrix and bias of a sensor, such as the 6×6 matrix of a force/torque sensor.

        calibration = Calibration(np.loadtxt("FT12345.txt")).tare(unloaded)

    Args:
        matrix: values per raw unit, shape (values, raw), such as N/V and N·m/V.
        bias: raw values without load, shape (raw,); None: zeros.

    Raises:
        ValueError: the shapes do not match, or a number is not finite.
    """

    matrix: Array
    bias: Array

    def __init__(self, matrix: npt.ArrayLike, bias: npt.ArrayLike | None = None) -> None:
        given = np.array(matrix, np.float64)
        if given.ndim != 2 or 0 in given.shape:
            raise ValueError(f"matrix has shape {given.shape}: must be (values, raw)")
        offset = np.zeros(given.shape[1]) if bias is None else np.array(bias, np.float64)
        if offset.shape != (given.shape[1],):
            raise ValueError(f"bias has shape {offset.shape}: must be ({given.shape[1]},)")
        if not (np.isfinite(given).all() and np.isfinite(offset).all()):
            raise ValueError("matrix and bias must be finite")
        object.__setattr__(self, "matrix", given)
        object.__setattr__(self, "bias", offset)

    def apply(self, raw: npt.ArrayLike) -> Array:
        """Return the values, shape (values,), of raw values, shape (raw,)."""
        result: Array = self.matrix @ (np.asarray(raw, np.float64) - self.bias)
        return result

    def tare(self, samples: npt.ArrayLike) -> Calibration:
        """Return a calibration with the mean of samples without load as its bias.

        Args:
            samples: raw values, shape (samples, raw).

        Raises:
            ValueError: no samples, another shape, or a value is not finite.
        """
        given = np.asarray(samples, np.float64)
        if given.ndim != 2 or given.shape[1] != len(self.bias) or not len(given):
            raise ValueError(
                f"samples have shape {given.shape}: must be (samples, {len(self.bias)})"
            )
        return Calibration(self.matrix, given.mean(axis=0))
