"""The watch over the cables of a running loop: error counters, asked for once a second.

One endless conversation in the acyclic lane, a frame for every 46 devices a second. What the
counters say of a cable, a device or its supply becomes an event, once a minute while it goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from catenary.bus import MainDevice
from catenary.bus.event_types import FaultFound
from catenary.errors import CatenaryError
from catenary.link import ring_of
from catenary.model.diagnosis import Observation, judge
from catenary.model.finding import Finding, Names
from catenary.model.topology import make_topology
from catenary.procedure.error_counters import Totals, counted_since, read_error_counters
from catenary.procedure.exchange import Procedure, after

PERIOD = 1.0  # [s] between two looks
SILENCE = 60.0  # [s] before the same place is named again


class ErrorWatch:
    """Owns the counters as they were seen last, and what has been told."""

    def __init__(self, main: MainDevice, now: Callable[[], float]) -> None:
        self._subs = main.subs
        self._tell = main.events.put
        self._now = now
        self._last: Totals = ()
        self._told: dict[str, float] = {}  # place → when [s]
        self.topology = make_topology(
            [sub.description.open_ports for sub in self._subs],
            ring=ring_of(main.link) is not None,
        )
        self.names = Names(tuple(sub.name for sub in self._subs))

    def run(self) -> Procedure[None]:
        """Goes on until it is cancelled."""
        while True:
            for finding in (yield from self.look()):
                self._report(finding)
            yield after(PERIOD)

    def look(self) -> Procedure[Sequence[Finding]]:
        """What the counters say of the time since the last look; of the first nothing: what was
        counted before the loop began is `main.diagnose()`'s."""
        try:
            totals = yield from read_error_counters([sub.station for sub in self._subs])
        except CatenaryError:  # frames are lost just now, or two answer to one address
            return ()
        before, self._last = self._last, totals
        if not before or totals == before:
            return ()
        counters, restarted = counted_since(totals, before)
        return judge(Observation(self.topology, self.names, counters, restarted))

    def _report(self, finding: Finding) -> None:
        now = self._now()
        if now - self._told.get(finding.where, -SILENCE) < SILENCE:
            return
        self._told[finding.where] = now
        sub = self._subs[finding.devices[-1]] if finding.devices else None
        message = f"{finding.where}: {finding.evidence}"
        self._tell(FaultFound(now, sub, message, finding))
