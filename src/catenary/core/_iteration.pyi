"""What `for cycle in loop` runs through."""

from collections.abc import Callable
from typing import Self

from catenary.core._engine import Engine

class Cycle:
    """The cycle that the actual values belong to. The same object every time: it reads the
    engine, so note down what you want to keep."""

    def __init__(self, engine: Engine) -> None: ...
    @property
    def number(self) -> int:
        """0 for the first cycle of the iteration; skipped instants leave gaps in `time` alone."""

    @property
    def time(self) -> float:
        """[s] since the first cycle of the iteration: a multiple of the period."""

    @property
    def ok(self) -> bool:
        """Every sync unit that is needed answered: the inputs are of this cycle."""

    @property
    def lost(self) -> int:
        """How many cycles in a row, up to this one, were not ok."""

    @property
    def late(self) -> bool:
        """Instants were skipped, or happened without new targets, since the cycle before."""

    @property
    def limited(self) -> bool:
        """The set-points sent last were limited on some axis: see `Drives.limited`."""

    @property
    def refused(self) -> bool:
        """Some target was NaN or infinite; its axis held instead."""

    @property
    def dry(self) -> bool:
        """The stream of set-points had run dry: the axes hold."""

    def spend(self, seconds: float) -> None:
        """In virtual time: lets time pass as if the body took that long [s]. On a NIC time passes
        by itself: computes that long, as `task.spend` does."""

class Iteration:
    """Steps the engine once for every `next`, and hands out its one Cycle.

    Calls `judge(flags)` when one of the CYCLE_* flags of `trouble` is set, or the devices' AL states
    together are not `al_status`; what it raises ends the iteration. The first step commits nothing.
    `beside` is called before every step.
    """

    def __init__(
        self,
        engine: Engine,
        judge: Callable[[int], None],
        *,
        trouble: int,
        al_status: int,
        beside: Callable[[], object] | None = None,
    ) -> None: ...
    def __iter__(self) -> Self: ...
    def __next__(self) -> Cycle: ...
