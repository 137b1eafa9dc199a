"""Events and summaries of a capture as JSON objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from enum import Enum
from typing import TypeAlias, cast

from catenary.capture import Device, Event, EventStream, MasterSummary
from catenary.capture.notes import notes
from catenary.wire.al import AlState

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"


def event_object(event: Event, device: Device | None) -> dict[str, Json]:
    """Return an event as an object.

    Args:
        event: The event.
        device: Its device; None for all devices.
    """
    content = {
        field.name: _plain(getattr(event.content, field.name)) for field in fields(event.content)
    }
    return {
        "time": round(event.time_ns * 1e-9, 9),
        "packet": event.packet,
        "master": event.master,
        "device": event.device,
        "position": device.position if device else None,
        "station": device.station if device else None,
        "step": str(event.step),
        "kind": event.content.kind,
        "text": str(event.content),
        **{name: value for name, value in content.items() if name != "text"},
    }


def summary_object(stream: EventStream) -> dict[str, Json]:
    """Return the last object: counts, masters, devices and statistics of a capture."""
    return {
        "summary": {
            "start_ns": stream.start_ns,
            **cast("dict[str, Json]", asdict(stream.counts)),
            "masters": [_master(each) for each in stream.masters],
            "notes": list(notes(stream.counts, stream.masters)),
        }
    }


def _master(summary: MasterSummary) -> Json:
    return {
        **cast("dict[str, Json]", _plain(summary.master)),
        "devices": _plain(summary.devices),
        "cycles": _plain(summary.cycles),
        "clocks": _plain(summary.clocks),
        "reference_clock": _plain(summary.reference),
    }


def _plain(value: object) -> Json:
    """Return a value of JSON: bytes as hex digits, states by name, other codes as numbers."""
    if isinstance(value, AlState):
        return str(value)
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, Enum):
        return value.name
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {str(name): _plain(each) for name, each in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(name): _plain(each) for name, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return cast("Json", value)
