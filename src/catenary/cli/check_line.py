"""`catenary check TARGET --against line/`: what has changed since a clone was made."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.failure import UsageError, one_line

if TYPE_CHECKING:
    from catenary.line import Line
    from catenary.line.change import Change, ChangedDevice, Comparison, Uncompared

SAME, DIFFERENT, UNREADABLE = 0, 1, 2


def run(arguments: argparse.Namespace) -> int:
    """Compare a segment or a clone with a clone, and print the changes."""
    from catenary.cli.check_line_text import as_text
    from catenary.line import read_line
    from catenary.line.compare import compare_lines

    old = read_line(arguments.against)  # first, because the devices of a segment take minutes
    new = _present(arguments)
    found = compare_lines(old, new)
    print(as_json(found, arguments) if arguments.json else as_text(found, arguments))
    for note in _notes(old, new):
        print(f"note: {one_line(note)}", file=sys.stderr)
    return status_of(found)


def _notes(old: Line, new: Line) -> Iterator[str]:
    """Yield the new contradictions of the wiring, and what the reading could not restore."""
    yield from (note for note in new.notes if note not in old.notes)
    for device in new.devices:
        if "state" in device.missing:
            yield f"device {device.position} ({device.name}): {device.missing['state']}"


def status_of(found: Comparison) -> int:
    """Return the exit status of a comparison."""
    if found.different:
        return DIFFERENT
    return UNREADABLE if found.unread else SAME


def _present(arguments: argparse.Namespace) -> Line:
    """Return the clone in a folder, or read the segment."""
    from catenary.line import read_line

    if Path(arguments.file).is_dir():
        if arguments.target is not None:
            raise UsageError("a clone has no target", hint="name only the folder of the clone")
        if arguments.pre_op:
            raise UsageError(
                "--pre-op needs a segment", hint="a clone is read without access to a device"
            )
        return read_line(arguments.file)
    return _read(arguments)


def _read(arguments: argparse.Namespace) -> Line:
    """Read the segment. Devices in SAFE-OP and OP are not written to."""
    from catenary.bus.clone import CloneOptions, read_segment
    from catenary.cli.check_machine import source_and_machine
    from catenary.cli.progress import Progress
    from catenary.target import MainDevice

    source, _ = source_and_machine(arguments.file, arguments.target)
    options = CloneOptions(pre_op=arguments.pre_op)
    with MainDevice(source) as main, Progress("read") as progress:
        return read_segment(main, options, progress.step)


def as_json(found: Comparison, arguments: argparse.Namespace) -> str:
    """Return the comparison as JSON."""
    from catenary.line.change import Severity

    shown = [
        each for each in found.changes if arguments.all or each.severity is not Severity.VARIABLE
    ]
    values = {
        "file": arguments.file,
        "against": arguments.against,
        "different": found.different,
        "compared": found.compared,
        "hidden": len(found.changes) - len(shown),
        "changes": [_change(each) for each in shown],
        "not_compared": [_uncompared(each) for each in found.uncompared],
    }
    return json.dumps(values, indent=2)


def _change(change: Change) -> dict[str, object]:
    return {
        "device": _device(change.device),
        "part": change.part,
        "what": change.what,
        "index": None if change.entry is None else change.entry.index,
        "subindex": None if change.entry is None else change.entry.subindex,
        "old": change.old,
        "new": change.new,
        "severity": change.severity,
        "note": change.note,
    }


def _uncompared(part: Uncompared) -> dict[str, object]:
    return {
        "device": _device(part.device),
        "part": part.part,
        "reason": part.reason,
        "expected": part.expected,
    }


def _device(device: ChangedDevice) -> dict[str, object]:
    return {"name": device.name, "old_position": device.old, "position": device.new}
