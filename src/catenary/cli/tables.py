"""Tables of text cells. The cells are escaped, because they may contain text from devices."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.cli.text import escaped


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as aligned text."""
    rows = [[escaped(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )
