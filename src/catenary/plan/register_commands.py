"""Register commands of an ENI in a plan, as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.model.register_command import RegisterCommand
from catenary.wire.datagram import EcatCommand

STEPS = ("IP", "PS", "SO")  # transitions in which Catenary sends commands


def register_lines(commands: Sequence[RegisterCommand]) -> Iterator[str]:
    """Yield one line for each command and transition, in the order of sending."""
    for step in STEPS:
        for each in commands:
            if step in each.transitions:
                reads = EcatCommand(each.command).reads
                what = "read" if reads else f"= {each.data.hex(' ')}"
                yield f"{step}  {each} {what}  ENI {each.source}"
