"""Trigger of another process that the cycle starts of a loop follow, and its watch."""

from __future__ import annotations

from collections.abc import Callable

from catenary.bus.event_types import Event, TriggerChanged
from catenary.core import Engine, TriggerBlock
from catenary.plan.trigger import Trigger
from catenary.procedure.exchange import Procedure, after

INTERVAL = 0.1  # [s] between two checks
NS = 1e-9


class TriggerWatch:
    """Owner of a loop's trigger. It puts an event when the cycles begin or cease to follow it.

    Args:
        trigger: Trigger that the loop sends or awaits.
        engine: Engine of the loop, which does not run yet.
        period_ns: Period of the loop [ns].
        put: Function that receives the events.

    Raises:
        ShareError: The memory of the trigger cannot be opened, or another loop sends it.
        ValueError: The cycle runs inline or in virtual time.
    """

    def __init__(
        self, trigger: Trigger, engine: Engine, period_ns: int, put: Callable[[Event], None]
    ) -> None:
        self._trigger = trigger
        self._engine = engine
        self._period_ns = period_ns
        self._put = put
        self._was_following: bool | None = None
        self._block = TriggerBlock(trigger.open())
        try:
            engine.set_trigger(self._block, trigger.sends)
        except BaseException:
            trigger.close()
            raise

    @property
    def following(self) -> bool:
        """True if the cycle starts are those of another loop."""
        return self._engine.following

    @property
    def missed(self) -> int:
        """Number of cycles that began without a trigger; 0 for a sender."""
        return self._engine.counters["missed_triggers"]

    def run(self) -> Procedure[None]:
        """Check the trigger periodically until cancelled; return at once for a sender."""
        while not self._trigger.sends:
            self.look()
            yield after(INTERVAL)

    def look(self) -> None:
        """Put an event if the loop has begun or ceased to follow the trigger."""
        following = self.following
        if following == self._was_following:
            return
        self._was_following = following
        text = "follow" if following else f"do not follow: {self._reason()}; they continue with"
        end = f"the trigger {self._trigger.name!r}" if following else "the clock of this machine"
        self._put(
            TriggerChanged(
                self._engine.now() * NS,
                None,
                f"trigger {self._trigger.name!r}: the cycle starts {text} {end}",
                following,
                self.missed,
            )
        )

    def close(self) -> None:
        """Release the trigger; a second call has no effect."""
        self._trigger.close()

    def _reason(self) -> str:
        theirs = self._block.period_ns
        if theirs not in (0, self._period_ns):
            return (
                f"its sender has a period of {theirs / 1e3:g} us, this loop of "
                f"{self._period_ns / 1e3:g} us"
            )
        return "no trigger arrives" if self._block.ticks else "no loop has sent it yet"
