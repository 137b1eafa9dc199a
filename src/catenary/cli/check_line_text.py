"""Changes since a clone as text: a table by device, a summary, and the next steps."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby

from catenary.cli.check_advice import next_steps
from catenary.cli.failure import one_line
from catenary.line.change import Change, ChangedDevice, Comparison, Severity

WHAT_WIDTH = 44  # columns; a longer name moves the values to the right
BOTH_WIDTH = 56  # columns of two values on one line
_SEVERITY_WIDTH = max(len(each) for each in Severity)
_NOUNS = {
    Severity.EFFECT: ("change with an effect", "changes with an effect"),
    Severity.FAULT: ("fault", "faults"),
    Severity.INFO: ("info", "info"),
}


def as_text(found: Comparison, arguments: argparse.Namespace) -> str:
    """Return the changes by device, the parts that were not compared, and what to do next.

    Args:
        found: The comparison.
        arguments: The command line.
    """
    shown = [
        each for each in found.changes if arguments.all or each.severity is not Severity.VARIABLE
    ]
    lines = list(_devices(shown))
    for part in found.uncompared:
        lines.append(f"not compared: {one_line(str(part))}")
    lines.append(_summary(found, len(found.changes) - len(shown), arguments.against))
    lines += [f"  next: {one_line(step)}" for step in next_steps(found, arguments)]
    return "\n".join(lines)


def _devices(changes: Sequence[Change]) -> Iterator[str]:
    for device, group in groupby(changes, key=lambda each: each.device):
        yield one_line(_headline(device))
        for change in group:
            yield from _lines(change)


def _headline(device: ChangedDevice) -> str:
    if device.old is None or device.new is None or device.old == device.new:
        return str(device)
    return f"{device}, earlier device {device.old}"


def _lines(change: Change) -> Iterator[str]:
    """Yield a change on one line, or on three if its values are long."""
    what = one_line(f"{change.part} {change.what}")
    head = f"  {change.severity:{_SEVERITY_WIDTH}}  {what:{WHAT_WIDTH}}"
    old, new = one_line(change.old), one_line(change.new)
    indent = " " * (_SEVERITY_WIDTH + 4)
    if len(old) + len(new) <= BOTH_WIDTH:
        yield f"{head}  {old} → {new}"
    else:
        yield head.rstrip()
        yield f"{indent}before  {old}"
        yield f"{indent}now     {new}"
    if change.note:
        yield f"{indent}{one_line(change.note)}"


def _summary(found: Comparison, hidden: int, against: str) -> str:
    counts = Counter(each.severity for each in found.changes)
    texts = [
        f"{counts[severity]} {nouns[counts[severity] != 1]}" for severity, nouns in _NOUNS.items()
    ]
    compared = f"{found.compared} {'device' if found.compared == 1 else 'devices'} compared"
    more = f"; --all shows {hidden} more values that change by themselves" if hidden else ""
    unread = "; not everything could be compared" if found.unread else ""
    total = ", ".join(texts) if any(counts[each] for each in _NOUNS) else f"as in {against}"
    return f"{compared}: {total}{unread}{more}"
