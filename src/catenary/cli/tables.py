"""Tables of words. Words may be text from devices and are escaped."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.cli.text import escaped


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as aligned text."""
    rows = [[escaped(word) for word in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )
