"""Events of a loop, as lines of JSON in a ring."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from catenary.errors import ShareError
from catenary.plan.sink import Incident
from catenary.share.layout import EVENT_SIZE

CUT_OFF = " ..."


class SharedEvent(msgspec.Struct, frozen=True):
    """An event of a loop."""

    serial: int  # of the event, from 1
    number: int  # of the last cycle before it; 0: before the first
    kind: str  # the name of its class in `cat.events`, or of the error that ended the loop
    message: str
    time: float  # of the loop's clock [s]
    position: int | None  # of the device; None: about the segment
    details: Mapping[str, object]

    def __str__(self) -> str:
        return f"{self.time:.3f} s, cycle {self.number}: {self.message}"


def encode_event(incident: Incident, serial: int, number: int) -> bytes:
    """Encode an event into one row. If it is too long, drop details, then truncate the message."""
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
        kept = max(len(event.message) - (len(line) - EVENT_SIZE) - len(CUT_OFF), 0)
        event = msgspec.structs.replace(event, message=event.message[:kept] + CUT_OFF)
        line = msgspec.json.encode(event)
    return line


def encodable(value: object) -> object:
    """Replace characters that UTF-8 cannot encode by '?': a device's text must not stop a loop."""
    return value.encode(errors="replace").decode() if isinstance(value, str) else value


def decode_event(row: bytes | bytearray) -> SharedEvent:
    """Return the event of a row. Raises ShareError if the row is damaged."""
    try:
        return msgspec.json.decode(row.rstrip(b"\0"), type=SharedEvent)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ShareError(f"an event of the share is damaged: {error}") from error
