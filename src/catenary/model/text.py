"""Clean-up of texts from devices: names in the SII and in the object dictionary."""

from __future__ import annotations


def printable(text: str) -> str:
    """Return the printable characters of a name, without leading and trailing spaces."""
    return "".join(c for c in text if c.isprintable()).strip()
