"""Events and hardware counters of a network, read while the loop runs.

Once per second, the error counters of all devices are read in the acyclic queue of the loop. The
diagnosis locates the bad cable between two devices, as TOCABI's status thread does.
"""

from __future__ import annotations

from collections.abc import Iterator

import catenary as cat
from catenary.bus import Pending
from catenary.bus.diagnosis import Diagnosis, diagnose

PERIOD = 1.0  # [s] between two diagnoses


class Status:
    """Owner of the newest diagnosis of a network. Call `step` once per cycle."""

    def __init__(self, main: cat.MainDevice, name: str) -> None:
        self.readings = 0  # number of complete readings of all counters
        self._main, self._name = main, name
        self._next = 0.0  # [s]
        self._pending: Pending[Diagnosis] | None = None
        self._diagnosis: Diagnosis | None = None
        self._known: set[tuple[object, str]] = set()

    def step(self, now: float) -> Iterator[str]:
        """Yield what is new at the time `now` [s]: events, and faults that the counters show."""
        for event in self._main.events:
            if isinstance(event, cat.events.FaultFound):
                continue  # the diagnosis below finds it, too
            yield f"{self._name}: {event.message}"
        if self._pending is None and now >= self._next:
            self._next = now + PERIOD
            self._pending = self._main.request(
                diagnose(self._main.subs, since=self._diagnosis, ring=True)
            )
        elif self._pending is not None and self._pending.done:
            pending, self._pending = self._pending, None
            if pending.error is None:
                yield from self._judge(pending.result())

    def _judge(self, found: Diagnosis) -> Iterator[str]:
        """Yield the faults that earlier diagnoses did not show. The first one is the reference."""
        is_first, self._diagnosis = self._diagnosis is None, found
        self.readings += 1
        for finding in () if is_first else found.findings:
            if (key := (finding.kind, finding.where)) not in self._known:
                self._known.add(key)
                yield f"{self._name} counters: {finding.where}: {finding.evidence}"
