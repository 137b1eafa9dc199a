"""Values of unknown type and times as text."""

from __future__ import annotations

from collections.abc import Callable

MAXIMUM_SHOWN = 32  # bytes
_NUMBER_SIZES = (1, 2, 4, 8)
_UNITS: tuple[tuple[float, str, Callable[[float], str]], ...] = (
    (1e9, "s", lambda value: f"{value:.3f}"),
    (1e6, "ms", lambda value: f"{value:.3f}"),
    (1e3, "us", lambda value: f"{value:.3f}"),
)


def value_text(data: bytes) -> str:
    """Return a number for 1, 2, 4 or 8 bytes, a text for printable bytes, else hex digits.

    The number has the width of the data: 0x0601 has two bytes.
    """
    if len(data) in _NUMBER_SIZES:
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    stripped = data.rstrip(b"\x00")
    if len(stripped) > 2 and all(0x20 <= byte < 0x7F for byte in stripped):
        return repr(stripped.decode("ascii"))
    if len(data) > MAXIMUM_SHOWN:
        return f"{data[:MAXIMUM_SHOWN].hex()}... ({len(data)} bytes)"
    return data.hex() or "empty"


def duration(ns: float) -> str:
    """Return a time with its unit, such as 12.5 ms."""
    for unit, name, form in _UNITS:
        if abs(ns) >= unit:
            return f"{form(ns / unit).rstrip('0').rstrip('.')} {name}"
    return f"{ns:.0f} ns"


def not_accepted(accepted: bool) -> str:
    """Return the note for a write that no device processed; empty if one did."""
    return "" if accepted else ", not accepted (working counter 0)"
