"""`catenary graph TARGET`: draw the wiring of the devices."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_json,
    add_target,
    note_other_masters,
)

if TYPE_CHECKING:
    from catenary.bus import MainDevice, SubDevice
    from catenary.cli.drawing import Drawing


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "graph",
        help="draw the wiring of the devices",
        description="Draws the devices, ports, cable delays, states and error counters of the "
        "segment as a tree. A delay is one-way, and includes the previous device. It is "
        "known only between devices with clocks. Exit status 1 if the ports contradict each other.",
        example="catenary graph eth0\ncatenary graph eth0 --dot | dot -Tsvg -o segment.svg",
    )
    add_target(parser)
    parser.add_argument("--dot", action="store_true", help="print a graph for Graphviz")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.target import MainDevice, named_target

    if arguments.dot and arguments.json:
        raise UsageError("--dot and --json exclude each other")
    with MainDevice(arguments.target, force=True) as main:  # this command only reads
        note_other_masters(main)
        subs = main.passive_scan()
        drawing = draw(named_target(arguments.target), main, subs)
    print(formatted(drawing, arguments))
    if arguments.dot:
        for text in drawing.topology.contradictions:
            print(f"catenary: {text}", file=sys.stderr)
    return int(bool(drawing.topology.contradictions))


def formatted(drawing: Drawing, arguments: argparse.Namespace) -> str:
    """Return the drawing in the format of the options."""
    from catenary.cli.drawing import as_text, as_values
    from catenary.cli.drawing_dot import as_dot

    if arguments.json:
        return json.dumps(as_values(drawing), indent=2)
    return as_dot(drawing) if arguments.dot else as_text(drawing)


def draw(target: str, main: MainDevice, subs: Sequence[SubDevice]) -> Drawing:
    """Read counters, delays and states from the devices. Return the drawing."""
    from catenary.cli.drawing import Drawing, Node
    from catenary.model.cable_delay import cable_delays_ns
    from catenary.procedure.al_status_poll import survey
    from catenary.procedure.receive_times import read_receive_times

    found = main.diagnose(subs=subs)
    times = main.converse(read_receive_times([sub.description for sub in subs]))
    answers = main.converse(survey([sub.station for sub in subs]))
    closed = (
        found.topology.second_end is not None
    )  # in a ring, frames from both ends latch the times
    delays = cable_delays_ns(found.topology, [None if closed else each for each in times])
    nodes = tuple(
        Node(sub.name, sub.alias, _state(answer.word), delay, errors)
        for sub, answer, delay, errors in zip(subs, answers, delays, found.totals, strict=True)
    )
    return Drawing(target, found.topology, nodes)


def _state(word: int | None) -> str:
    from catenary.errors import DecodeError
    from catenary.wire.al import AlStatus

    if word is None:
        return "silent"
    try:
        status = AlStatus.from_word(word)
    except DecodeError:
        return f"state {word & 0xF}"
    return f"{status.state} + ERROR" if status.error else str(status.state)
