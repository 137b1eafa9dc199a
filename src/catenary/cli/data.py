"""`catenary data SHARE`: print the newest cycle of a running loop."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from catenary.cli.arguments import share_name
from catenary.cli.parsers import Commands, add_command, add_json, add_uid
from catenary.cli.plain import plain

if TYPE_CHECKING:
    from catenary.share import Reader

TIMEOUT = 2.0  # [s] for the first cycle


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "data",
        help="print the newest cycle of a running loop",
        description="Prints all fields of the newest cycle from the share of a running loop: "
        "times and flags of the cycle, actual values, targets, named process data, and the bytes "
        "of devices without names. Reading does not delay the loop.",
        example="catenary data arm\ncatenary data arm --json",
    )
    parser.add_argument("share", metavar="SHARE", type=share_name, help="name of the loop's share")
    add_uid(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.share import attach

    with attach(arguments.share, uid=arguments.uid) as reader:
        if not reader.number:
            reader.wait(TIMEOUT)
        values = newest(reader)
        as_json = arguments.json
        print(
            json.dumps(as_values(reader, values), indent=2) if as_json else as_text(reader, values)
        )
    return 0


def newest(reader: Reader) -> dict[str, object]:
    """Return the fields of the newest cycle as plain numbers and lists, by name."""
    row = reader.read()
    return {field.name: plain(row[field.name].tolist()) for field in reader.layout.fields}


def as_values(reader: Reader, values: dict[str, object]) -> dict[str, object]:
    """Return the cycle for JSON."""
    layout = reader.layout
    return {
        "share": layout.name,
        "state": reader.state,
        "period": layout.period,
        "axes": list(layout.axes),
        "fields": values,
        "units": {field.name: field.unit for field in layout.fields if field.unit},
    }


def as_text(reader: Reader, values: dict[str, object]) -> str:
    """Return a table with a line for each field."""
    from catenary.cli.tables import table

    layout = reader.layout
    axes = f"axes: {', '.join(layout.axes)}" if layout.axes else "no axes"
    rows = [(each.name, each.unit, _cell(values[each.name])) for each in layout.fields]
    return "\n".join([f"{layout.name}: {reader.state}, {axes}", table(rows)])


def _cell(value: object) -> str:
    if isinstance(value, list):
        return " ".join(_cell(each) for each in value)
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
