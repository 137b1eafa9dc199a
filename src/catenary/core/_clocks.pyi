"""Distributed clocks of a cycle.

`plan` is a catenary.plan.ClockPlan, read by attribute. ValueError names an invalid field.
"""

class PhaseController:
    """Controller that computes corrections of the cycle start from phase errors."""

    def __init__(self, plan: object, period_ns: int) -> None: ...
    def step(self, error_ns: int | None) -> int:
        """Advance the controller by one cycle. Return the shift of the next cycle start [ns].

        Args:
            error_ns: Phase error of the last cycle start [ns], at most half a period; positive if
                the start was late. None if the reference did not answer in this cycle.
        """

    @property
    def drift(self) -> float:
        """Estimated lasting correction of each period [ns]."""
    @property
    def bandwidth(self) -> float: ...
    @property
    def jumps(self) -> int:
        """Number of jumps of the reference clock."""

class Clock:
    """Owner of the distributed clocks of a cycle: `Engine.clock`."""

    def __init__(self, plan: object, period_ns: int) -> None: ...
    def figures(self) -> dict[str, float]:
        """Return the figures of the clocks; all times in ns.

        - locked: True if clocks and phase error have been within the bound for a number of cycles.
        - bound: the bound in force.
        - following: True once the cycle starts were set in phase.
        - time: last system time of the reference clock.
        - time_sent: link time at which the frame that read it was sent.
        - error, mean_error, worst_error: phase error of the cycle starts. If the reference clock
          follows the MainDevice, this is the error of the reference clock.
        - rate: deviation of the reference clock's rate from the link clock's, as a ratio.
        - samples: number of times that the reference clock was read.
        - missed, silent: number of cycles without its answer, in total and in a row.
        - holding: True while the core continues the time of a lost reference clock.
        - ignored: number of samples rejected as outliers. jumps: number of jumps of the clock.
        """

    def differences(self) -> list[tuple[float, int, int, int]]:
        """Return (mean, last, largest magnitude, number of reads) for each follower.

        The difference is 0x092C, local minus reference time [ns].
        """

    def reset_figures(self) -> None:
        """Reset the largest phase error and the largest differences."""

    def keep_within(self, bound_ns: int) -> None:
        """Set the bound for clock differences and phase error [ns], from the next cycle on.

        A new bound unlocks the clocks until they have been within it for a number of cycles.

        Raises:
            ValueError: The bound is not positive.
        """

    def set_epoch(self, epoch_ns: int) -> None:
        """Set the epoch, which is system time minus link time [ns]. Call it before `start`."""

    @property
    def changes(self) -> int:
        """Number of times the clocks were locked or unlocked. Reading it clears CYCLE_CLOCKS."""
