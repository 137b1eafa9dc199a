"""Distributed clocks of a cycle.

`plan` is a catenary.plan.ClockPlan, read by attribute. ValueError names an invalid field.
"""

class PhaseController:
    """Phase controller: phase errors in, corrections of the cycle start out."""

    def __init__(self, plan: object, period_ns: int) -> None: ...
    def step(self, error_ns: int | None) -> int:
        """Return the shift of the next cycle start [ns].

        Args:
            error_ns: Phase error of the last cycle start [ns], within half a period of 0; positive:
                late. None: no answer in this cycle.
        """

    @property
    def drift(self) -> float:
        """Lasting difference between the periods [ns]."""
    @property
    def bandwidth(self) -> float: ...
    @property
    def jumps(self) -> int:
        """Number of jumps of the reference clock."""

class Clock:
    """Owner of the distributed clocks of a cycle: `Engine.clock`."""

    def __init__(self, plan: object, period_ns: int) -> None: ...
    def figures(self) -> dict[str, float]:
        """Return the figures of the clocks; times in ns.

        locked; bound (in force); following (True: in phase). time: last system time of the
        reference; time_sent: when the frame that read it left, on the link's clock. error,
        mean_error, worst_error: phase error of the cycle starts, or of the reference if it follows.
        rate: of the reference relative to the link's clock, as a ratio. samples. missed, silent:
        cycles without the reference, in total and in a row. holding: the core continues its time.
        ignored: samples larger than any drift. jumps.
        """

    def differences(self) -> list[tuple[float, int, int, int]]:
        """Return (mean, last, largest magnitude, reads) of each follower [ns].

        The difference is 0x092C, local minus reference.
        """

    def reset_figures(self) -> None:
        """Reset the largest magnitudes."""

    def keep_within(self, bound_ns: int) -> None:
        """Set the bound for clock differences and phase error [ns]."""

    def set_epoch(self, epoch_ns: int) -> None:
        """Set the epoch, which is system time minus link time [ns]. Call it before `start`."""

    @property
    def changes(self) -> int:
        """Number of times the clocks were locked or unlocked. Reading it clears CYCLE_CLOCKS."""
