"""Comparisons of captures as JSON: the same rows as the text."""

from __future__ import annotations

from catenary.capture import Device
from catenary.capture.compared_master import Side
from catenary.capture.diff import CaptureComparison
from catenary.capture.difference import DeviceComparison, Difference, Mark
from catenary.cli.capture_json import Json


def as_object(comparison: CaptureComparison, a: str, b: str) -> dict[str, Json]:
    """Return the comparison as an object.

    Args:
        comparison: The result.
        a: Path of A.
        b: Path of B.
    """
    first = comparison.first
    return {
        "equal": comparison.equal,
        "a": _side(comparison.a, a),
        "b": _side(comparison.b, b),
        "until": str(comparison.until),
        "devices": [_device(each) for each in comparison.devices],
        "counts": {mark.value: comparison.count(mark) for mark in Mark},
        "effects": comparison.count(Mark.DIFFERS, effect=True),
        "first": None
        if first is None
        else {
            "device": first.device.pair.device.position,
            "subject": first.row.subject,
            "text": first.text,
            "before_error_in": first.side or None,
            "error": first.error,
        },
    }


def _side(side: Side, name: str) -> dict[str, Json]:
    master = side.summary.master if side.summary else None
    return {
        "file": name,
        "master": master.name if master else "",
        "source": master.source.hex(":") if master else None,
        "masters": side.masters,
        "devices": len(side.summary.devices) if side.summary else 0,
        "start_up": None if side.start_up_ns is None else round(side.start_up_ns * 1e-9, 9),
    }


def _device(device: DeviceComparison) -> dict[str, Json]:
    return {
        "a": _identity(device.pair.a),
        "b": _identity(device.pair.b),
        "registers": device.registers,
        "objects": device.objects,
        "rows": [_row(row) for row in device.rows],
    }


def _identity(device: Device | None) -> Json:
    if device is None:
        return None
    return {
        "position": device.position,
        "station": device.station,
        "vendor": device.vendor,
        "product": device.product,
        "revision": device.revision,
        "serial": device.serial,
        "name": device.order or device.name,
    }


def _row(row: Difference) -> dict[str, Json]:
    return {
        "mark": row.mark.value,
        "step": str(row.step),
        "topic": row.topic.value,
        "subject": row.subject,
        "a": row.a or None,
        "b": row.b or None,
        "effect": row.effect,
        "note": row.note,
        "packet_a": row.packet_a,
        "packet_b": row.packet_b,
    }
