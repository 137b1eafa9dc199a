"""Rows of a printed timeline: consecutive similar events are merged."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass

from catenary.capture.events import Event
from catenary.capture.mailbox_contents import MailboxMessage
from catenary.capture.register_contents import FmmuWrite, SyncManagerWrite
from catenary.capture.text import duration, not_accepted


@dataclass(frozen=True, slots=True)
class Row:
    """One or more consecutive events of the same device, step and kind."""

    first: Event
    last: Event
    count: int = 1

    def __str__(self) -> str:
        first, last = self.first.content, self.last.content
        if self.count == 1:
            return str(first)
        if isinstance(first, FmmuWrite) and isinstance(last, FmmuWrite) and first != last:
            return f"FMMU{first.number} to FMMU{last.number} off{not_accepted(first.accepted)}"
        managers = isinstance(first, SyncManagerWrite) and isinstance(last, SyncManagerWrite)
        if managers and first != last:
            return f"SM{first.number} to SM{last.number} off{not_accepted(first.accepted)}"
        lasted = duration(self.last.time_ns - self.first.time_ns)
        return f"{first} ({self.count} times in {lasted})"


def merge(events: Iterable[Event]) -> Iterator[Row]:
    """Yield rows. A run of similar events becomes one row."""
    row: Row | None = None
    for event in events:
        if row is not None and _key(row.last) == _key(event) and _follows(row.last, event):
            row = Row(row.first, event, row.count + 1)
            continue
        if row is not None:
            yield row
        row = Row(event, event)
    if row is not None:
        yield row


def _key(event: Event) -> Hashable:
    content = event.content
    similar: Hashable = content
    if isinstance(content, FmmuWrite) and not content.fmmu.enabled:
        similar = "FMMU", content.accepted
    elif isinstance(content, SyncManagerWrite) and _is_cleared(content):
        similar = "SyncManager", content.accepted
    elif isinstance(content, MailboxMessage):
        similar = content.protocol, content.to_device, content.text
    return event.master, event.device, event.step, similar


def _follows(last: Event, event: Event) -> bool:
    """Return True if the numbers of two cleared FMMUs or SyncManagers follow each other."""
    a, b = last.content, event.content
    if isinstance(a, FmmuWrite | SyncManagerWrite) and isinstance(b, FmmuWrite | SyncManagerWrite):
        return a == b or b.number == a.number + 1
    return True


def _is_cleared(content: SyncManagerWrite) -> bool:
    return not (content.address or content.length or content.control or content.enabled)
