"""Handle of a running law, and the error of a law that failed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary import core
from catenary.errors import LawError
from catenary.log import Log
from catenary.loop.laws.law import CompiledLaw, Law

Numbers = npt.NDArray[np.float64]


class LawRun:
    """Law that runs natively in the cycle. `Loop.start` returns this object."""

    def __init__(
        self,
        law: Law,
        compiled: CompiledLaw,
        native: core.Law,
        engine: core.Engine,
        parameters: Numbers,
    ) -> None:
        self.law = law
        self._parameters = parameters
        self._compiled = compiled  # owns the code that the native law calls
        self._native = native
        self._engine = engine

    @property
    def parameters(self) -> Numbers:
        """Copy of the last assigned parameters.

        Assigning replaces all of them at once, before the next step. Raises ValueError if the
        length differs.
        """
        return self._parameters.copy()

    @parameters.setter
    def parameters(self, values: Sequence[float] | Numbers) -> None:
        row = numbers("parameters", values)
        self._native.set_parameters(row)
        self._parameters = np.array(row)

    @property
    def running(self) -> bool:
        """True until the law has ended."""
        return not self._native.ended

    @property
    def failed(self) -> bool:
        """True if the law has ended by an error, such as an exception or a NaN target."""
        return self._native.status > core.LAW_STOPPED

    @property
    def memory(self) -> Numbers:
        """Copy of the law's memory after its last step.

        Assigning replaces all of it at once, before the next step. Raises ValueError if the length
        differs.
        """
        return np.array(self._native.memory)

    @memory.setter
    def memory(self, values: Sequence[float] | Numbers) -> None:
        self._native.set_memory(numbers("memory", values))

    @property
    def steps(self) -> int:
        """Number of steps so far."""
        return self._native.figures["steps"]

    @property
    def overruns(self) -> int:
        """Number of steps that took longer than the budget."""
        return self._native.figures["overruns"]

    @property
    def longest(self) -> float:
        """Longest step so far [s]."""
        return self._native.figures["longest_ns"] * 1e-9

    def stop(self) -> None:
        """Stop the law; a no-op if it has ended. From the next cycle on, Python sets the targets.

        Until the next commit, the axes hold. CST keeps its torque for `StopPolicy.handover`.
        """
        if self.running:
            self._engine.stop_law()

    def error(
        self, axes: Sequence[str], log: Log | None, replay: Callable[[], str]
    ) -> LawError | None:
        """Return the error of a law that failed; None if it did not fail.

        Args:
            axes: Names of the axes.
            log: The last cycles.
            replay: Runs the last step as Python, and returns the exception as text.
        """
        reasons: dict[int, Callable[[], tuple[str, str]]] = {
            core.LAW_RAISED: lambda: (
                f"raised an exception{replay()}",
                "probably an index out of bounds: loop.run(..., compiled=False) shows the line",
            ),
            core.LAW_NEVER_RETURNED: lambda: (
                "did not return",
                "check for a loop whose end depends on the inputs",
            ),
            core.LAW_NOT_FINITE: lambda: (
                f"left NaN or infinity in the target of {axes[self._native.axis]}",
                "check for a division by zero, or a NaN input (a quantity that the drive lacks)",
            ),
            core.LAW_OVERRUN: lambda: (
                f"exceeded its budget too often, with up to {self.longest * 1e6:.0f} us",
                "make it faster, or raise the limits: Loop.run(..., budget=..., overruns=...)",
            ),
        }
        if self._native.status not in reasons:
            return None
        what, hint = reasons[self._native.status]()
        text = f"law {self.law} {what} in step {self.steps}; the drives were stopped"
        return LawError(text, log=log, hint=hint)


def numbers(name: str, values: Any) -> list[float]:
    """Return a one-dimensional sequence of numbers as floats.

    Args:
        name: Name for the error message.
        values: Sequence of numbers.

    Raises:
        TypeError: A value cannot be converted to a float.
        ValueError: A text is not a number, or the sequence is not one-dimensional.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1:
        raise ValueError(f"{name}: must be one-dimensional, not of shape {array.shape}")
    row: list[float] = array.tolist()
    return row
