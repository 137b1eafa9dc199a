"""The cycle and the distributed clocks. `plan` is a catenary.plan.ClockPlan, read by attribute;
ValueError names what cannot be."""

class PhaseController:
    """The phase controller alone: errors in, corrections out."""

    def __init__(self, plan: object, period_ns: int) -> None: ...
    def step(self, error_ns: int | None) -> int:
        """What the next instant moves by [ns], for the error of the last one (within half a period
        of 0; positive: late); None: no answer in this cycle."""

    @property
    def drift(self) -> float:
        """By which periods differ lastingly [ns]."""
    @property
    def bandwidth(self) -> float: ...
    @property
    def jumps(self) -> int:
        """How often the clock has jumped."""

class Clock:
    """Owns what a cycle knows of distributed clocks: `Engine.clock`."""

    def __init__(self, plan: object, period_ns: int) -> None: ...
    def figures(self) -> dict[str, float]:
        """locked, bound (in force), following (in phase or on the way), time (system time of the
        reference, the last one), time_sent (link's time, when the frame left that brought it),
        error, mean_error, worst_error (of the instants' phase; where the reference follows: its
        own), rate (of the reference against the link's clock, a share), samples, missed, silent
        (cycles without the reference, in all and in a row), holding (its time is kept here),
        ignored (samples beyond any drift), jumps. Times in ns."""

    def differences(self) -> list[tuple[float, int, int, int]]:
        """Per follower (0x092C, local minus reference): mean, last, largest magnitude [ns], reads."""

    def reset_figures(self) -> None:
        """Forgets the largest magnitudes."""

    def keep_within(self, bound_ns: int) -> None:
        """The bound of differences and phase from now on."""

    def set_epoch(self, epoch_ns: int) -> None:
        """System time minus the link's time, before `start`."""

    @property
    def changes(self) -> int:
        """How often the clocks came together or apart; reading it ends CYCLE_CLOCKS."""
