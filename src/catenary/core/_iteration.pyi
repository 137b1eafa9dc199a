"""Iteration of a loop, and the cycle that it yields."""

from collections.abc import Callable, Sequence
from threading import Lock
from typing import Protocol, Self

from catenary.core._engine import Engine

class Cycle:
    """The cycle of the current actual values.

    It is the same object in every iteration: copy what you want to keep.
    """

    def __init__(self, engine: Engine) -> None: ...
    @property
    def number(self) -> int:
        """Number of the cycle; 0 for the first cycle of the iteration.

        Skipped cycle starts leave gaps in `time` only.
        """

    @property
    def time(self) -> float:
        """Cycle start relative to the first cycle of the iteration, on the link's clock [s].

        It is a multiple of the period, unless the cycle starts follow the reference clock. Then it
        is the elapsed time.
        """

    @property
    def ok(self) -> bool:
        """True if every required sync unit answered, so that the inputs are of this cycle."""

    @property
    def lost(self) -> int:
        """Number of cycles in a row, up to this one, that were not ok."""

    @property
    def late(self) -> bool:
        """True if cycles were skipped, or ran without new targets, since the previous iteration."""

    @property
    def limited(self) -> bool:
        """True if a set-point (see `Drives.limited`) or an output column was limited."""

    @property
    def refused(self) -> bool:
        """True if a target or column was refused: NaN, infinite, or beyond the step limit."""

    @property
    def dry(self) -> bool:
        """True if the stream of set-points was empty (an underrun)."""

    @property
    def networks(self) -> tuple[Cycle, ...]:
        """Cycle of each network of the loop; with one network, only this cycle."""

    def spend(self, seconds: float) -> None:
        """Let virtual time pass as if the body took this long [s]. In real time, busy-wait."""

class Mover(Protocol):
    """Source of targets that the loop steps before each commit."""

    def step(self, now: float, /) -> None: ...

class Iteration:
    """Iterator that steps the engine once per `next` and yields its one Cycle.

    It calls `judge(flags)` if one of the CYCLE_* flags of `trouble` is set, or if the OR of the AL
    states differs from `al_status`. An exception of `judge` ends the iteration. The first step
    commits no set-points. `beside` is called before every step. Each mover of the list `movers`
    computes targets before every step that commits, with the time of the cycle [s]. With a
    `commit_lock`, a step that finds it taken commits nothing, because another thread is writing the
    targets.
    """

    def __init__(
        self,
        engine: Engine,
        judge: Callable[[int], None],
        *,
        trouble: int,
        al_status: int,
        beside: Callable[[], object] | None = None,
        movers: Sequence[Mover] | None = None,
    ) -> None: ...
    commit_lock: Lock | None
    def __iter__(self) -> Self: ...
    def __next__(self) -> Cycle: ...
    def step_movers(self) -> None:
        """Call `step` of all movers, as every committing step does."""
