"""Watch of what devices report about themselves: diagnosis messages and synchronisation counters.

It is an endless procedure in the acyclic queue, with at most one SDO request at a time. It reads
one device after the other, each once per interval. It never acknowledges a message. Messages and
counts from before the first reading are not reported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from catenary.bus import SubDevice
from catenary.bus.event_types import DiagnosisReported, Event, SynchronisationFault
from catenary.errors import CatenaryError, SdoAbort
from catenary.model.diagnosis_history import RawHistory, RawMessage, SyncCounter, described
from catenary.procedure.diagnosis_history import (
    Upload,
    read_history,
    read_state,
    read_sync_counters,
)
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.mailbox import turn_comes
from catenary.procedure.sdo import OBJECT_MISSING
from catenary.wire.al import AlState

MESSAGES_PER_READING = 20  # of one device; older ones stay on the device
FAILURES_MAX = 3  # in a row, before a device is left out for a while
PAUSE = 10  # readings of a device that are left out
TURN_MAX = 0.1  # [s] for a turn in the queue of a mailbox
PERIOD_MIN = 0.001  # [s] between two devices
COUNTS = 1 << 16  # counters have 16 bits

Counts = dict[tuple[int, SyncCounter], int]


@dataclass(slots=True)
class _Subject:
    """State of one device in the watch."""

    sub: SubDevice
    begun: bool = False  # True after the first reading of messages
    has_history: bool = True
    has_counters: bool = True
    last: RawMessage | None = None
    counts: Counts = field(default_factory=dict)
    reported: dict[SyncCounter, int] = field(default_factory=dict)  # last reported values
    failures: int = 0
    left_out: int = 0  # readings


class DiagnosisWatch:
    """Watch of the devices with an object dictionary.

    Args:
        subs: Devices of the loop.
        interval: Time between two readings of a device [s].
        put: Function that receives the events.
        now: Function that returns the time for the events [s].
    """

    def __init__(
        self,
        subs: Sequence[SubDevice],
        interval: float,
        *,
        put: Callable[[Event], None],
        now: Callable[[], float],
    ) -> None:
        self._subjects = [_Subject(sub) for sub in subs if sub.description.coe]
        self._interval = interval
        self._put = put
        self._now = now

    def run(self) -> Procedure[None]:
        """Read the devices in turn until cancelled; return at once without devices."""
        pause = max(self._interval / max(len(self._subjects), 1), PERIOD_MIN)
        while self._subjects:
            for subject in self._subjects:
                yield from self._read(subject)
                yield after(pause)
            self._subjects = [s for s in self._subjects if s.has_history or s.has_counters]

    def _read(self, subject: _Subject) -> Procedure[None]:
        """Read one device and put its events. A device that does not answer is left out."""
        if subject.left_out:
            subject.left_out -= 1
            return
        if subject.sub.state is not AlState.OP:
            return  # it is lost or returning
        channel = subject.sub.channel  # None with an external master
        if channel is not None and not (yield from turn_comes(channel, TURN_MAX)):
            return  # a long request uses its mailbox, such as the transfer of a file
        try:
            if subject.has_history:
                yield from self._read_messages(subject)
                subject.begun = True
            if subject.has_counters:
                yield from self._read_counters(subject)
        except CatenaryError:  # frames are being lost, or its mailbox has failed
            subject.failures += 1
            if subject.failures >= FAILURES_MAX:
                subject.failures, subject.left_out = 0, PAUSE
            return
        subject.failures = 0

    # Messages

    def _read_messages(self, subject: _Subject) -> Procedure[None]:
        upload: Upload = subject.sub.sdo.upload_small
        try:
            state = yield from read_state(upload)
        except SdoAbort as error:
            if error.code not in OBJECT_MISSING:
                raise  # it refuses for now
            subject.has_history = False
            return
        if not state.newest:
            subject.last = None
            return
        known = subject.last is not None and subject.last.subindex == state.newest
        if known and not state.available:
            return
        limit = MESSAGES_PER_READING if subject.begun else 1
        found = yield from read_history(upload, subject.last, limit=limit, state=state)
        if subject.begun:
            self._report(subject, found)
        if found.messages:
            subject.last = found.messages[-1]

    def _report(self, subject: _Subject, found: RawHistory) -> None:
        sub = subject.sub
        for raw in found.messages:
            message = described(raw, sub.diagnosis.texts, found.now_ns)
            self._put(
                DiagnosisReported(
                    self._now(),
                    sub,
                    f"{sub.station}: {message.severity}: {message.text}",
                    message.severity,
                    message.text,
                    message.code,
                    message.text_id,
                    message.parameters,
                )
            )

    # Synchronisation

    def _read_counters(self, subject: _Subject) -> Procedure[None]:
        upload: Upload = subject.sub.sdo.upload_small
        found = yield from read_sync_counters(upload)
        counts = {
            (each.index, counter): number
            for each in found
            for counter, number in each.by_counter.items()
        }
        before = subject.counts
        subject.counts = before | counts  # a counter may be refused for now
        subject.has_counters = bool(subject.counts)
        for (index, counter), total in counts.items():
            count = _increase(before.get((index, counter), total), total)
            # Most devices have the same counter for outputs and inputs.
            if count and subject.reported.get(counter) != total:
                subject.reported[counter] = total
                self._put(self._fault(subject.sub, index, counter, count, total))
            elif not total:
                subject.reported.pop(counter, None)

    def _fault(
        self, sub: SubDevice, index: int, counter: SyncCounter, count: int, total: int
    ) -> SynchronisationFault:
        place = f"0x{index:04X}:{counter:02X}"
        number = f"{place} is set" if counter is SyncCounter.ERROR else f"{place} +{count}"
        message = f"{sub.station}: {counter.text} ({number})"
        return SynchronisationFault(
            self._now(), sub, message, index, counter.name.lower(), count, total
        )


def _increase(before: int, now: int) -> int:
    """Return the increase of a counter of 16 bits; the new value if the device was restarted."""
    if now >= before:
        return now - before
    return now + COUNTS - before if before - now > COUNTS // 2 else now
