"""Events of a loop, as JSON texts in a ring."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec

from catenary.errors import ShareError
from catenary.plan.sink import Incident
from catenary.share._rows import Ring
from catenary.share.layout import EVENT_SIZE

ELLIPSIS = " ..."


class SharedEvent(msgspec.Struct, frozen=True):
    """Event of a loop."""

    serial: int  # number of the event, counted from 1
    number: int  # number of the last cycle before the event; 0: before the first cycle
    kind: str  # name of the class in `cat.events`, or of the error that ended the loop
    message: str
    time: float  # on the clock of the loop [s]
    position: int | None  # position of the device; None: the event concerns the segment
    details: Mapping[str, object]

    def __str__(self) -> str:
        return f"{self.time:.3f} s, cycle {self.number}: {self.message}"


def encode_event(incident: Incident, serial: int, number: int) -> bytes:
    """Encode an event into one row of at most EVENT_SIZE bytes.

    If the event is too long, drop its details, and then truncate its message.

    Args:
        incident: the event.
        serial: serial number of the event.
        number: number of the last cycle before the event.
    """
    event = SharedEvent(
        serial,
        number,
        incident.kind,
        str(encodable(incident.message)),
        incident.time,
        incident.position,
        {key: encodable(value) for key, value in incident.details.items()},
    )
    line = msgspec.json.encode(event)
    if len(line) > EVENT_SIZE:
        event = msgspec.structs.replace(event, details={})
        line = msgspec.json.encode(event)
    while len(line) > EVENT_SIZE:
        kept = max(len(event.message) - (len(line) - EVENT_SIZE) - len(ELLIPSIS), 0)
        event = msgspec.structs.replace(event, message=event.message[:kept] + ELLIPSIS)
        line = msgspec.json.encode(event)
    return line


def encodable(value: object) -> object:
    """Replace characters that UTF-8 cannot encode by '?'.

    The text of a device must not stop a loop.
    """
    return value.encode(errors="replace").decode() if isinstance(value, str) else value


def read_events(ring: Ring, after: int) -> tuple[Iterator[SharedEvent], int]:
    """Copy the events of a ring after serial `after` that still exist, oldest first.

    Args:
        ring: ring of the events.
        after: serial number.

    Returns:
        The events, and how many between `after` and the last one were overwritten. An event is
        decoded when the iterator reaches it, which raises ShareError if it is damaged.
    """
    rows, lost = ring.copy_after(after)
    return (
        decode_event(rows[at : at + EVENT_SIZE]) for at in range(0, len(rows), EVENT_SIZE)
    ), lost


def decode_event(row: bytes | bytearray) -> SharedEvent:
    """Decode the event in a row. Raises ShareError if the row is damaged."""
    try:
        return msgspec.json.decode(row.rstrip(b"\0"), type=SharedEvent)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ShareError(f"an event of the share is damaged: {error}") from error
