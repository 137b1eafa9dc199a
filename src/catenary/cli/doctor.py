"""`catenary doctor [NIC]`: check whether this machine is ready for a real-time loop."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from catenary.cli.arguments import number, positive_seconds
from catenary.cli.failure import FAILED, UsageError
from catenary.cli.parsers import Commands, add_command, add_json

WIDTH = 100  # largest width of the report

if TYPE_CHECKING:
    from catenary.doctor import Change, Examination

EXAMPLE = """\
catenary doctor
catenary doctor eth0 --seconds 60
catenary doctor eth0 --json
sudo .venv/bin/catenary doctor eth0 --apply
sudo .venv/bin/catenary doctor --undo"""


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "doctor",
        help="check whether this machine is ready for real time",
        description="Checks the kernel, processors, clocks, permissions and a network card, and "
        "measures the wake-up latency of threads. Shows commands that solve the problems. Sends "
        "no frames, and changes nothing without --apply. docs/how_to/doctor.md explains every "
        "check. Exit status 1 if a check failed, or if a change was refused.",
        example=EXAMPLE,
    )
    parser.add_argument(
        "nic", metavar="NIC", nargs="?", help="network card of the segment, such as eth0"
    )
    _add_measurement(parser)
    add_json(parser)
    action = parser.add_mutually_exclusive_group()
    action.add_argument(
        "--apply",
        action="store_true",
        help="list reversible changes, ask for confirmation, and apply them",
    )
    action.add_argument("--undo", action="store_true", help="undo the changes by --apply")
    parser.add_argument(
        "--yes", action="store_true", help="with --apply, do not ask for confirmation"
    )
    parser.set_defaults(run=run)


def _add_measurement(parser: argparse.ArgumentParser) -> None:
    """Add the options of the thread that measures the wake-up latency."""
    parser.add_argument(
        "--seconds",
        type=seconds,
        default=3.0,
        help="duration of the latency test (default 3; 0 for no test)",
    )
    parser.add_argument(
        "--period",
        type=period,
        default=1e-3,
        metavar="SECONDS",
        help="period of the loop (default 0.001)",
    )
    parser.add_argument(
        "--priority",
        type=priority,
        default=80,
        help="priority of the loop's thread, 1 to 99 (default 80)",
    )
    parser.add_argument(
        "--cpu",
        type=number,
        help="CPU of the loop's thread (default: the last isolated CPU, else the last CPU)",
    )


def run(arguments: argparse.Namespace) -> int:
    from catenary.doctor import as_json, as_text

    if arguments.json and (arguments.apply or arguments.undo):
        raise UsageError("--json cannot be combined with --apply or --undo")
    if arguments.undo:
        return undo()
    examination = examine_machine(arguments)
    if arguments.json:
        print(as_json(examination))
    else:
        terminal = sys.stdout.isatty()
        columns = shutil.get_terminal_size().columns if terminal else WIDTH
        colour = terminal and "NO_COLOR" not in os.environ
        print(as_text(examination, colour=colour, width=min(columns, WIDTH)))
    if arguments.apply:
        refused = apply(examination.changes, ask=not arguments.yes)
        return FAILED if refused or examination.failed else 0
    return FAILED if examination.failed else 0


def examine_machine(arguments: argparse.Namespace) -> Examination:
    from catenary.doctor import examine, obtainable_cpu, this_machine, watch
    from catenary.errors import LinkError

    try:
        machine = this_machine(
            arguments.nic, cpu=arguments.cpu, period=arguments.period, priority=arguments.priority
        )
    except LinkError as error:  # exit status 1 is reserved for failed checks
        raise UsageError(error.message, hint=error.hint) from error
    except ValueError as error:
        raise UsageError(str(error)) from error
    if not arguments.seconds:
        return examine(machine)
    if not arguments.json and sys.stderr.isatty():
        print(f"measuring for {arguments.seconds:g} s ...", file=sys.stderr)
    cpu = obtainable_cpu(machine) if arguments.cpu is None else arguments.cpu
    return examine(*watch(machine, arguments.seconds, cpu=cpu))


def apply(changes: tuple[Change, ...], *, ask: bool) -> int:
    """List the changes, ask for confirmation, and apply them. Return the exit status."""
    from catenary.doctor import MachineGround, change_lines, open_state
    from catenary.doctor import apply as make

    if not changes:
        print("\nNo reversible changes to apply. Run the commands above yourself.")
        return 0
    ground = MachineGround()
    print("\nChanges until `catenary doctor --undo` or a reboot:")
    print(*change_lines(changes, ground), sep="\n")
    if os.geteuid() != 0:
        print("(Most changes need root: use sudo with the full path of this command.)")
    if ask and not agreed():
        print("Nothing was changed.")
        return 0
    return print_report(make(changes, ground, open_state()))


def agreed() -> bool:
    if not sys.stdin.isatty():
        raise UsageError(
            "--apply asks for confirmation, but stdin is not a terminal", hint="use --apply --yes"
        )
    return input("Apply these changes? [y/N] ").strip().lower() in ("y", "yes")


def undo() -> int:
    from catenary.doctor import MachineGround, open_state
    from catenary.doctor import undo as take_back

    state = open_state()
    if not state.load():
        print(f"Nothing to undo: {state.path} contains no changes since the last reboot.")
        return 0
    return print_report(take_back(MachineGround(), state))


def print_report(lines: Iterable[str]) -> int:
    refused = False
    for line in lines:
        print(line)
        refused |= line.startswith("REFUSED")
    return FAILED if refused else 0


def seconds(text: str) -> float:
    return 0.0 if text in ("0", "0.0") else positive_seconds(text)


def period(text: str) -> float:
    from catenary.realtime.task import check_period

    value = positive_seconds(text)
    try:
        check_period("latency", "period", value)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return value


def priority(text: str) -> int:
    value = number(text)
    if not 1 <= value <= 99:
        raise argparse.ArgumentTypeError(f"priority {value} is outside 1 to 99")
    return value
