"""Compilation, trial and execution of the laws of an open loop, natively or as Python."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from catenary import core
from catenary.errors import LawError
from catenary.log import Log
from catenary.loop.laws.compiler import SOURCES, compile_law, counted_allocations
from catenary.loop.laws.law import CompiledLaw, Law
from catenary.loop.laws.layout import law_layout, record_at
from catenary.loop.laws.run import LawRun, Numbers, numbers
from catenary.plan.planner import Plan

GUARD_ABOVE = 1  # priority of the guard thread above that of the cycle thread
PRIORITY_MAX = 99
BUDGET_SHARE = 0.4  # share of the period; the frames need the remainder


class LawRunner:
    """Compiled laws of a loop, and the running law."""

    def __init__(self, engine: core.Engine, plan: Plan) -> None:
        self._engine = engine
        self._axes = [axis.name for axis in plan.cycle.axes]
        self._period_ns = plan.cycle.period_ns
        above = (plan.cycle.priority or -GUARD_ABOVE) + GUARD_ABOVE
        self._priority = min(above, PRIORITY_MAX)
        self._layout = law_layout(engine, plan.tables)
        self._compiled: dict[Law, CompiledLaw] = {}
        self._run: LawRun | None = None

    @property
    def current(self) -> LawRun | None:
        """The law that was started last; None before the first one, and after a failure."""
        return self._run

    @property
    def has_failed(self) -> bool:
        """True if the law has failed, and `failure` has not returned its error yet."""
        return self._run is not None and self._run.failed

    def compile(self, law: Law) -> CompiledLaw:
        """Compile a law once, and return the result."""
        if law not in self._compiled:
            self._compiled[law] = compile_law(law, self._layout)
        return self._compiled[law]

    def start(
        self,
        law: Law,
        memory: Sequence[float] | Numbers,
        parameters: Sequence[float] | Numbers,
        budget: float | None,
        overruns: int,
    ) -> LawRun:
        """Compile the law if necessary, try it on copies, and start it in the cycle.

        Args:
            law: Law to start.
            memory: Initial state, float64.
            parameters: Values from the application, float64.
            budget: Longest time of one step [s]; None: a share of the period; 0: no check.
            overruns: Number of consecutive steps over the budget that end the law.

        Returns:
            Handle of the running law.

        Raises:
            LawError: The law cannot be compiled, or does not return.
            TypeError: A value of `memory` or `parameters` cannot be converted to a float.
            ValueError: An argument is impossible.
            OSError: The monitor thread cannot be started.
        """
        if budget is not None and not budget >= 0:
            raise ValueError(f"budget={budget} s: must be 0 or more")
        if overruns < 1:
            raise ValueError(f"overruns={overruns}: must be at least 1")
        compiled = self.compile(law)
        given = numbers("parameters", parameters)
        if law.parameters and len(given) != len(law.parameters):
            names = ", ".join(each.name for each in law.parameters)
            raise ValueError(
                f"parameters: {len(given)} given, but law {law} has {len(law.parameters)}: {names}"
            )
        native = core.Law(
            compiled.address,
            numbers("memory", memory),
            given,
            budget_ns=round(BUDGET_SHARE * self._period_ns if budget is None else budget * 1e9),
            overrun_limit=overruns,
            priority=self._priority,
        )
        run = LawRun(law, compiled, native, self._engine, np.array(given))
        self._try(law, native)
        self._engine.start_law(native)
        self._run = run
        return run

    def _try(self, law: Law, native: core.Law) -> None:
        """Run a few steps on copies of the present values, to load the code of the law.

        Warn if the law allocates memory. Raise LawError if it does not return. An exception of the
        law is not an error here.
        """
        actual, target = self._engine.blocks()
        with counted_allocations() as allocated:
            result = native.rehearse(bytes(actual), bytes(target))
            if allocated():
                warnings.warn(
                    f"law {law} allocates memory in every step, probably by an expression on whole "
                    "arrays; this is sometimes slow: use a loop over the axes",
                    stacklevel=4,
                )
        if result == core.LAW_ABORTED:
            raise LawError(
                f"law {law} did not return when it was tried on the present values",
                hint="check for a loop whose end depends on the inputs",
            )

    def run(self, run: LawRun, advance: Callable[[], None]) -> None:
        """Wait for the end of a law, and raise its error, if any.

        Args:
            run: Handle of the running law.
            advance: Function that waits or runs cycles for a short time. It raises the error of a
                bad cycle or a failed law.
        """
        while run.running:
            advance()
        if (failure := self.failure(None)) is not None:
            raise failure

    def failure(self, log: Log | None) -> LawError | None:
        """Return the error of a failed law. Return None without a failure, and on later calls.

        Args:
            log: The last cycles.
        """
        run = self._run
        error = run.error(self._axes, log, lambda: self._replay(run)) if run else None
        if error is not None:
            self._run = None
        return error

    def _replay(self, run: LawRun) -> str:
        """Run the last step again as Python on copies; return its exception as text, or ""."""
        try:
            time = (run.steps - 1) * self._period_ns * 1e-9
            self._step(run.law, run.memory, run.parameters, time, copies=True)
        except Exception as error:  # a law can raise any exception
            line = traceback.extract_tb(error.__traceback__)[-1].lineno
            return f" ({type(error).__name__}: {error}, line {line})"
        return ""

    def python_step(
        self, law: Law, memory: Sequence[float] | Numbers, parameters: Sequence[float] | Numbers
    ) -> tuple[Callable[[float], bool], Numbers]:
        """Return one step as Python (time → True if finished), and its memory.

        Args:
            law: Law to run.
            memory: Initial state.
            parameters: Values from the application.
        """
        kept = np.array(numbers("memory", memory))
        given = np.array(numbers("parameters", parameters))
        return lambda time: self._step(law, kept, given, time), kept

    def _step(
        self, law: Law, memory: Numbers, parameters: Numbers, time: float, *, copies: bool = False
    ) -> bool:
        actual, target = self._engine.blocks()
        if copies:
            actual, target = memoryview(bytes(actual)), memoryview(bytearray(target))
        names: dict[str, Any] = {
            "actual": record_at(actual, self._layout.actual),
            "target": record_at(target, self._layout.target),
            "memory": memory,
            "parameters": parameters,
            "time": time,
        }
        for name in law.arguments:
            if name not in names:
                names[name] = getattr(names["actual"], SOURCES[name].rpartition(".")[2])
        return bool(law(*(names[name] for name in law.arguments)))
