"""Report about a machine as one HTML file without scripts, for a vendor."""

from __future__ import annotations

import html
import time
from importlib.metadata import version
from platform import platform

import msgspec

from catenary.dashboard.hub import Hub
from catenary.dashboard.requests import FAILURES

SECTIONS = (
    ("Diagnosis", "diagnosis"),
    ("Devices", "devices"),
    ("Axes", "axes"),
    ("Timing", "timing"),
    ("Clocks", "clocks"),
    ("Plan", "plan"),
)
STYLE = """\
body { font: 14px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em }
table { border-collapse: collapse; margin: 0.5em 0 }
th, td { border: 1px solid #8888; padding: 0.2em 0.6em; text-align: left; vertical-align: top }
pre { overflow-x: auto }
"""
DEPTH_MAX = 6  # of nested tables


async def make_report(hub: Hub) -> str:
    """Return the report. A section that the program cannot provide contains the error."""
    parts = [section("Program", as_html(program_facts(hub)))]
    for title, method in SECTIONS:
        try:
            result = msgspec.to_builtins(await hub.requests.call(method, {}))
        except FAILURES as error:
            parts.append(section(title, f"<p>not available: {html.escape(str(error))}</p>"))
        else:
            parts.append(section(title, as_html(result)))
    parts.append(section("Events", as_html(hub.event_rows())))
    return page(f"Report of {hub.source.name}", "".join(parts))


def program_facts(hub: Hub) -> dict[str, object]:
    """Return the facts about the program and this machine."""
    reader = hub.source.reader
    facts: dict[str, object] = {
        "time": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime()),
        "Catenary": version("catenary"),
        "system": platform(),
        "share": hub.source.name,
    }
    if reader is None:
        return facts | {"state": hub.source.reason}
    layout = reader.layout
    return facts | {
        "program": str(layout.writer),
        "period": f"{layout.period * 1e3:g} ms",
        "cycles": reader.number,
        "axes": ", ".join(layout.axes),
    }


def as_html(value: object, depth: int = 0) -> str:
    """Return a value as HTML: a mapping or a list of mappings as a table. Texts are escaped."""
    if depth > DEPTH_MAX:
        return html.escape(str(value))
    if isinstance(value, dict):
        rows = (
            f"<tr><th>{html.escape(str(key))}</th><td>{as_html(each, depth + 1)}</td></tr>"
            for key, each in value.items()
        )
        return f"<table>{''.join(rows)}</table>"
    if isinstance(value, list | tuple) and value and all(isinstance(each, dict) for each in value):
        return table(value, depth)
    if isinstance(value, list | tuple):
        return ", ".join(as_html(each, depth + 1) for each in value)
    if isinstance(value, str) and "\n" in value:
        return f"<pre>{html.escape(value)}</pre>"
    return html.escape("" if value is None else str(value))


def table(rows: list[dict[str, object]] | tuple[dict[str, object], ...], depth: int) -> str:
    """Return a table with one line for each mapping.

    Args:
        rows: mappings.
        depth: depth of the nesting.
    """
    columns = list(dict.fromkeys(key for row in rows for key in row))
    head = "".join(f"<th>{html.escape(str(key))}</th>" for key in columns)
    lines = (
        "".join(f"<td>{as_html(row.get(key), depth + 1)}</td>" for key in columns) for row in rows
    )
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def section(title: str, content: str) -> str:
    """Return a section of the report. The content is HTML."""
    return f"<h2>{html.escape(title)}</h2>{content}"


def page(title: str, content: str) -> str:
    """Return the document. The content is HTML."""
    name = html.escape(title)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{name}</title>'
        f"<style>{STYLE}</style></head><body><h1>{name}</h1>{content}</body></html>"
    )
