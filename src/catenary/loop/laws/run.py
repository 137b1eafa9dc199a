"""LawRun: a law while it runs, and what is said of one that failed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary import core
from catenary.errors import LawError
from catenary.log import Log
from catenary.loop.laws.compiler import CompiledLaw
from catenary.loop.laws.law import Law

Numbers = npt.NDArray[np.float64]


class LawRun:
    """A law that runs in the cycle, natively. Made by `Loop.start` and `Loop.run`."""

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
        """A copy of what was given last. Assigning replaces all at once, before the next step;
        ValueError for another number of numbers."""
        return self._parameters.copy()

    @parameters.setter
    def parameters(self, values: Sequence[float] | Numbers) -> None:
        row = numbers("parameters", values)
        self._native.set_parameters(row)
        self._parameters = np.array(row)

    @property
    def running(self) -> bool:
        return not self._native.ended

    @property
    def memory(self) -> Numbers:
        """A copy of the law's memory as its last step left it. Assigning replaces it, all at once,
        before the next step; ValueError for another number of numbers."""
        return np.array(self._native.memory)

    @memory.setter
    def memory(self, values: Sequence[float] | Numbers) -> None:
        self._native.set_memory(numbers("memory", values))

    @property
    def steps(self) -> int:
        return self._native.figures["steps"]

    @property
    def overruns(self) -> int:
        """How many steps took longer than the budget."""
        return self._native.figures["overruns"]

    @property
    def longest(self) -> float:
        """[s] the longest step so far."""
        return self._native.figures["longest_ns"] * 1e-9

    def stop(self) -> None:
        """From the next cycle on the axes hold, and Python says the targets."""
        if self.running:
            self._engine.stop_law()

    def error(
        self, axes: Sequence[str], log: Log | None, replay: Callable[[], str]
    ) -> LawError | None:
        """Why it failed; None: it did not. `axes`: their names; `replay` runs its last step as
        Python and tells what that raises."""
        reasons: dict[int, Callable[[], tuple[str, str]]] = {
            core.LAW_RAISED: lambda: (
                f"raised an exception{replay()}",
                "an index out of bounds, most likely: loop.run(..., compiled=False) shows the line",
            ),
            core.LAW_NEVER_RETURNED: lambda: (
                "did not return",
                "look for a loop whose end depends on the inputs",
            ),
            core.LAW_NOT_FINITE: lambda: (
                f"left NaN or infinity in the target of {axes[self._native.axis]}",
                "look for a division by zero, or an input that is NaN (a quantity the drive lacks)",
            ),
            core.LAW_OVERRUN: lambda: (
                f"took longer than its budget too often, at most {self.longest * 1e6:.0f} us",
                "make it shorter, or Loop.run(..., budget=..., overruns=...)",
            ),
        }
        if self._native.status not in reasons:
            return None
        what, hint = reasons[self._native.status]()
        text = f"law {self.law} {what} in step {self.steps}; the drives were stopped"
        return LawError(text, log=log, hint=hint)


def numbers(name: str, values: Any) -> list[float]:
    """A row of numbers as floats. ValueError for anything else."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1:
        raise ValueError(f"{name}: a row of numbers, not an array of shape {array.shape}")
    row: list[float] = array.tolist()
    return row
