"""Watch of the error counters of the devices, which are read once per second.

It is an endless procedure in the acyclic queue. For up to 46 devices, it sends one frame per
second. A finding about a cable, a device or its supply becomes an event, at most once per minute.
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

PERIOD = 1.0  # [s] between two readings
SILENCE = 60.0  # [s] before the same place is reported again


class ErrorWatch:
    """Watch of the error counters. It keeps their last reading and the times of the reports."""

    def __init__(self, main: MainDevice, now: Callable[[], float]) -> None:
        self._subs = main.subs
        self._put = main.events.put
        self._now = now
        self._last: Totals = ()
        self._reported: dict[str, float] = {}  # place → time of its last event [s]
        self.topology = make_topology(
            [sub.description.open_ports for sub in self._subs],
            ring=ring_of(main.link) is not None,
        )
        self.names = Names(tuple(sub.description.full_name for sub in self._subs))

    def run(self) -> Procedure[None]:
        """Read the counters once per period until cancelled."""
        while True:
            for finding in (yield from self.look()):
                self._report(finding)
            yield after(PERIOD)

    def look(self) -> Procedure[Sequence[Finding]]:
        """Read the counters, and return the findings since the previous reading.

        The first call returns none, and neither does a call that cannot read the counters.
        `main.diagnose()` covers the counts from before the loop.
        """
        try:
            totals = yield from read_error_counters([sub.station for sub in self._subs])
        except CatenaryError:  # frames are being lost, or two devices have the same address
            return ()
        before, self._last = self._last, totals
        if not before or totals == before:
            return ()
        counters, restarted = counted_since(totals, before)
        return judge(Observation(self.topology, self.names, counters, restarted))

    def _report(self, finding: Finding) -> None:
        now = self._now()
        if now - self._reported.get(finding.where, -SILENCE) < SILENCE:
            return
        self._reported[finding.where] = now
        sub = self._subs[finding.devices[-1]] if finding.devices else None
        message = f"{finding.where}: {finding.evidence}"
        self._put(FaultFound(now, sub, message, finding))
