"""Rows of a printed timeline: consecutive similar events are merged."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass

from catenary.capture.events import Event
from catenary.capture.mailbox_contents import MailboxMessage
from catenary.capture.register_contents import EepromAssigned, FmmuWrite, SyncManagerWrite
from catenary.capture.text import duration, not_accepted


@dataclass(frozen=True, slots=True)
class Row:
    """One or more consecutive events of the same device, step and kind."""

    first: Event
    last: Event
    count: int = 1

    def __str__(self) -> str:
        first, last = self.first.content, self.last.content
        if isinstance(last, EepromAssigned) or self.count == 1:
            return str(last)
        if first != last and isinstance(first, FmmuWrite | SyncManagerWrite):
            name = "FMMU" if isinstance(first, FmmuWrite) else "SM"
            numbers = f"{name}{first.number} to {name}{first.number + self.count - 1}"
            return f"{numbers} off{not_accepted(first.accepted)}"
        lasted = duration(self.last.time_ns - self.first.time_ns)
        return f"{first} ({self.count} times in {lasted})"


def merge(events: Iterable[Event]) -> Iterator[Row]:
    """Yield rows. A run of similar events becomes one row."""
    row: Row | None = None
    for event in events:
        if row is not None and _key(row.last) == _key(event) and _follows(row, event):
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
    elif isinstance(content, EepromAssigned):
        similar = "EEPROM", content.accepted
    elif isinstance(content, MailboxMessage):
        similar = content.protocol, content.to_device, content.text
    return event.master, event.device, event.step, similar


def _follows(row: Row, event: Event) -> bool:
    """Return True if an event continues a row: equal contents, or consecutive numbers."""
    content, first, last = event.content, row.first.content, row.last.content
    if isinstance(content, FmmuWrite | SyncManagerWrite) and isinstance(last, type(content)):
        if content == last:
            return first == last
        return content.number == last.number + 1 and (row.count == 1 or first != last)
    return True


def _is_cleared(content: SyncManagerWrite) -> bool:
    return not (content.address or content.length or content.control or content.enabled)
