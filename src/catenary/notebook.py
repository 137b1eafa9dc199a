"""Tables and text as HTML, for `_repr_html_` in notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return an HTML table. The first cell of each row is its heading; all text is escaped."""
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "".join(
        f"<tr><th>{escape(first)}</th>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in rest)
        + "</tr>"
        for first, *rest in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def lines(text: Iterable[str]) -> str:
    """Return a paragraph with each text on a separate line."""
    return f"<p>{'<br>'.join(map(escape, text))}</p>"


def preformatted(text: str) -> str:
    """Return text as HTML with its columns preserved."""
    return f"<pre>{escape(text)}</pre>"
