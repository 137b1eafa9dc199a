"""Unit codes of dictionary entries as text, ETG.1004 (after CiA 303-2).

A code has four bytes: prefix (power of ten), numerator, denominator, and a reserved one.
"""

from __future__ import annotations

_PREFIXES = {0: "", 3: "k", 6: "M", 9: "G", -1: "d", -2: "c", -3: "m", -6: "u", -9: "n"}
_NOTATIONS = {
    **{0x01: "m", 0x02: "g", 0x03: "s", 0x04: "A", 0x05: "K", 0x06: "mol", 0x07: "cd"},
    **{0x10: "rad", 0x11: "sr", 0x20: "Hz", 0x21: "N", 0x22: "Pa", 0x23: "J", 0x24: "W"},
    **{0x25: "C", 0x26: "V", 0x27: "F", 0x28: "Ohm", 0x29: "S", 0x2A: "Wb", 0x2B: "T"},
    **{0x2C: "H", 0x2D: "degC", 0x41: "deg", 0x44: "l", 0x47: "min", 0x48: "h", 0x4E: "bar"},
}


def unit_text(code: int | None) -> str:
    """Return a unit such as "mV" or "m/s"; the code for an unknown unit; empty without a unit."""
    if not code:
        return ""
    prefix, top, below = code >> 24, code >> 16 & 0xFF, code >> 8 & 0xFF
    exponent = prefix - 256 if prefix > 127 else prefix
    known = exponent in _PREFIXES and top in _NOTATIONS and (not below or below in _NOTATIONS)
    if not known or code & 0xFF or code >> 32:
        return f"unit 0x{code:08X}"
    unit = _PREFIXES[exponent] + _NOTATIONS[top]
    return f"{unit}/{_NOTATIONS[below]}" if below else unit
