"""Self-contained HTML page of a recording: plots as SVG, results per axis, events.

The page loads no other files and contains no scripts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from io import StringIO
from math import degrees
from typing import Any

from catenary.record.recording import Recording
from catenary.record.series import count_of, largest, of_axes, rms, tracking_error

SHOWN_EVENTS = 500
STYLE = """\
body { margin: 0 auto; padding: 2rem 1.25rem; max-width: 80rem; background: #fbfaf7;
  color: #1d2430; font: 15px/1.5 system-ui, "Segoe UI", "Noto Sans", "DejaVu Sans", sans-serif; }
h1 { margin: 0; font-size: 1.7rem; } h2 { margin: 2rem 0 0.5rem; font-size: 1.1rem; }
p { color: #5f6b7a; margin: 0.35rem 0; }
figure, .table { margin: 0; background: #fff; border: 1px solid #dfe3e8; border-radius: 8px;
  padding: 0.6rem; overflow-x: auto; }
svg { display: block; width: 100%; height: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.92rem; }
th, td { padding: 0.3rem 0.9rem; text-align: right; border-bottom: 1px solid #dfe3e8;
  white-space: nowrap; }
td:last-child { white-space: normal; }
tr:last-child td, tr:last-child th { border-bottom: 0; }
thead th { color: #5f6b7a; font-weight: 500; }
tbody th, .words td, .words th { text-align: left; }
"""


def as_html(recording: Recording, figure: Any, *, reference: str | None, unit: str) -> str:
    """Return the HTML page of a recording.

    Args:
        recording: the recording.
        figure: result of `draw` for the same recording.
        reference: field to compare positions with; None to omit the tracking error.
        unit: unit of angles, "rad" or "deg".
    """
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(recording.name)}</title>
<style>
{STYLE}</style>
</head>
<body>
<h1>{escape(recording.name)}</h1>
<p>{escape(_summary(recording))}</p>
{_axis_table(recording, reference, unit)}
<h2>Cycles</h2>
<figure>{_svg(figure)}</figure>
{_event_table(recording)}
</body>
</html>
"""


def _summary(recording: Recording) -> str:
    lost = f"{recording.lost} cycles lost" if recording.lost else "no cycle lost"
    return (
        f"{count_of(len(recording.axes), 'axis', 'axes')} at {1.0 / recording.period:.6g} Hz, "
        f"{len(recording)} cycles, {lost}; ended: {recording.ended}."
    )


def _svg(figure: Any) -> str:
    text = StringIO()
    figure.suptitle("")  # the page has its own heading
    figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]


def _axis_table(recording: Recording, reference: str | None, unit: str) -> str:
    length = recording.unit("position") or "rad"
    if length != "rad" or unit == "rad":
        factor, name = (1.0, length) if " " in length else (1e3, f"m{length}")
    else:
        factor, name = degrees(1.0), "°"
    speed, effort = recording.unit("velocity") or "rad/s", recording.unit("torque") or "N·m"
    error = tracking_error(recording, reference)
    velocity, torque = of_axes(recording, "velocity"), of_axes(recording, "torque")
    columns = {"axis": list(recording.axes)}
    if error is not None:
        columns[f"error, rms [{name}]"] = [f"{x * factor:.4g}" for x in rms(error)]
        columns[f"error, max [{name}]"] = [f"{x * factor:.4g}" for x in largest(error)]
    if velocity is not None:
        columns[f"velocity, max [{speed}]"] = [f"{x:.4g}" for x in largest(velocity)]
    if torque is not None:
        columns[f"torque, rms [{effort}]"] = [f"{x:.4g}" for x in rms(torque)]
        columns[f"torque, max [{effort}]"] = [f"{x:.4g}" for x in largest(torque)]
    if len(columns) == 1 or not len(recording):
        return ""
    rows = zip(*columns.values(), strict=True)
    return "<h2>Axes</h2>\n" + _table(list(columns), rows)


def _event_table(recording: Recording) -> str:
    if not recording.events:
        return ""
    start = recording.start_ns * 1e-9
    rows = [
        (
            f"{event.time - start:.4f}",
            str(event.number),
            "" if event.position is None else str(event.position),
            event.kind,
            event.message,
        )
        for event in recording.events[:SHOWN_EVENTS]
    ]
    left = len(recording.events) - len(rows)
    more = f"<p>The recording contains {left} more events.</p>" if left else ""
    heads = ["time [s]", "cycle", "device", "kind", "message"]
    return "<h2>Events</h2>\n" + _table(heads, rows, kind=" words") + more


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], *, kind: str = "") -> str:
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "\n".join(
        f"<tr><th>{escape(row[0])}</th>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="table{kind}"><table><thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )
