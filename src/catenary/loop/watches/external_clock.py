"""Watch of the external clock that the cycle starts follow."""

from __future__ import annotations

from collections.abc import Callable

from catenary.bus.event_types import Event, ExternalClockChanged
from catenary.loop.clock_discipline import (
    ClockSample,
    Discipline,
    DisciplineOptions,
    ExternalState,
)
from catenary.loop.external_clock import ExternalClock, HardwareClock, read_sample
from catenary.procedure.exchange import Procedure, after

NS = 1e-9
TEXTS: dict[ExternalState, str] = {
    "locked": "the cycle starts follow {name}",
    "seeking": "the cycle starts are {error:+.1f} us off {name}; the phase is being corrected",
    "lost": "{name} does not answer; the cycle starts continue at its last rate",
}


class ExternalClockWatch:
    """Readings of an external clock, and the rate of the periods that results: `Loop.external`.

    Args:
        clock: External clock.
        options: Settings of the discipline.
        now_ns: Function that returns the time of the link's clock [ns].
        cycle_start_ns: Function that returns the newest cycle start on that clock [ns].
        steer: Function that sets the relative change of the periods.
        put: Function that receives the events.

    Raises:
        ClockError: The clock cannot be opened.
    """

    def __init__(
        self,
        clock: ExternalClock,
        options: DisciplineOptions,
        *,
        now_ns: Callable[[], int],
        cycle_start_ns: Callable[[], int],
        steer: Callable[[float], None],
        put: Callable[[Event], None],
    ) -> None:
        self._clock = clock
        self._options = options
        self._source = clock.open()
        self._now_ns = now_ns
        self._cycle_start_ns = cycle_start_ns
        self._steer = steer
        self._put = put
        self._discipline = Discipline(options, now_ns())
        self._fault = ""  # of the last reading

    @property
    def state(self) -> ExternalState:
        """State: "seeking" until the phase is corrected, then "locked"; "lost" without clock."""
        return self._discipline.state

    @property
    def locked(self) -> bool:
        """True if the phase error is within the bound and the clock answers."""
        return self.state == "locked"

    @property
    def phase_error(self) -> float:
        """Last lateness of a cycle start in the time of the external clock [s]."""
        return self._discipline.error_ns * NS

    @property
    def rate(self) -> float:
        """Relative rate of the external clock against the link's clock; positive: faster."""
        return -self._discipline.drift

    @property
    def jumps(self) -> int:
        """Number of jumps of the external clock."""
        return self._discipline.jumps

    def run(self) -> Procedure[None]:
        """Read the clock periodically until cancelled."""
        while True:
            self.look()
            yield after(self._options.interval)

    def look(self) -> None:
        """Read the clock, set the rate of the periods, and put events for changes."""
        discipline = self._discipline
        state, jumps = discipline.state, discipline.jumps
        self._steer(discipline.step(self._now_ns(), self._read()))
        if discipline.jumps > jumps:
            self._report(f"{self._clock.name} has jumped; the cycle starts move slowly")
        if discipline.state != state:
            self._report(
                TEXTS[discipline.state].format(name=self._clock.name, error=self.phase_error * 1e6)
            )

    def close(self) -> None:
        """Close the device of the clock; a second call has no effect."""
        if isinstance(self._source, HardwareClock):
            self._source.close()

    def __str__(self) -> str:
        return (
            f"external clock {self._clock.name}: {self.state}, phase error "
            f"{self.phase_error * 1e6:+.3f} us, rate {self.rate * 1e6:+.2f} ppm, {self.jumps} jumps"
        )

    def _read(self) -> ClockSample | None:
        """Return a reading; None if there is none. Report an exception of a program's clock."""
        fault, sample = "", None
        try:
            sample = read_sample(self._source, self._now_ns, self._cycle_start_ns)
        except Exception as error:  # the discipline must continue at the last rate
            fault = f"{self._clock.name} has raised {type(error).__name__}: {error}"
        if fault and fault != self._fault:
            self._report(fault)
        self._fault = fault
        return sample

    def _report(self, message: str) -> None:
        self._put(
            ExternalClockChanged(self._now_ns() * NS, None, message, self.state, self.phase_error)
        )
