"""`catenary`: parse the arguments, run one command, and report errors."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from catenary import __version__
from catenary.cli import (
    alias,
    aoe,
    bench,
    capture,
    check,
    clone,
    completion,
    dashboard,
    data,
    demo,
    diag,
    doctor,
    eoe,
    esi,
    firmware,
    foe,
    foxglove,
    gateway,
    graph,
    include,
    init,
    merge,
    messages,
    pdos,
    plot,
    realtime,
    record,
    reg,
    report,
    ros2,
    scan,
    sdo,
    shell,
    sii,
    soe,
    state,
    top,
    virtual,
)
from catenary.cli.failure import USAGE, silence_stdout
from catenary.cli.failure import report as report_error

VIRTUAL_TIME = "times are virtual: they come from the segment's clock, not from this machine's"
PROGRAM = "catenary"
DESCRIPTION = "Real-time EtherCAT for Python."
COMMANDS = (
    *(scan, state, graph, diag, messages, pdos, sdo, foe, aoe, soe, firmware, eoe, reg, alias),
    *(sii, esi, gateway, init, check, clone, capture),
    *(demo, shell, dashboard, top, doctor, bench, report, virtual, realtime),
    *(data, record, merge, plot, foxglove, ros2, include, completion),
)
EPILOG = """\
TARGET is one of
  eth0               a network interface; `ip link` lists them
  eth0,eth1          two interfaces, if the segment is a ring between them
  virtual            a virtual segment: coupler, outputs, three servos, outputs
  virtual:FILE.toml  a virtual segment from a file (docs/reference/segment_file.md)
  virtual:FOLDER/    twins of the devices of a clone (docs/how_to/test_your_machine.md)
  virtual-realtime[:FILE.toml]  the same, on this machine's clock
  machine.toml       the target in a machine file (docs/reference/machine_file.md)
  share:NAME         the running program that owns a share: scan, state, diag, messages, sdo ...
  igh:0              the IgH kernel master 0 (docs/how_to/igh.md): scan, pdos, messages and sdo

example:
  catenary demo
  catenary scan eth0
"""


class Parser(argparse.ArgumentParser):
    """Parser that reports an error in one line, with a hint."""

    def error(self, message: str) -> NoReturn:
        self.exit(USAGE, f"{self.prog}: {message}\n  hint: {self.prog} --help\n")


class ShowVersion(argparse.Action):
    """Action that prints the version."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"catenary {__version__}")
        parser.exit()


def make_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog=PROGRAM,
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=ShowVersion, nargs=0, help="print the version")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    parser.set_defaults(make_parser=make_parser)  # for `completion`
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_parser(commands)
    return parser


def main(
    arguments: Sequence[str] | None = None,
    parser: Callable[[], argparse.ArgumentParser] = make_parser,
    *,
    program: str = PROGRAM,
) -> int:
    """Run one command of `parser`, by default of `catenary`.

    Return the exit status: 0 for success, 1 for a failure, 2 for a wrong command line, 141 if the
    reader of stdout has closed. `check` also returns 2 if it cannot compare.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given  # before or after the command
    try:
        return run([word for word in given if word != "--debug"], parser())
    except BrokenPipeError:
        return silence_stdout()
    except Exception as error:
        if debug:
            raise
        return report_error(error, program)


def note_virtual_time(target: str) -> None:
    """Print a note on stderr if the command ran in virtual time."""
    if not target.startswith("virtual") and not target.endswith(".toml"):
        return  # avoids the import
    from catenary.target.parse import in_virtual_time

    if in_virtual_time(target):
        print(f"note: {VIRTUAL_TIME}", file=sys.stderr)


def run(arguments: Sequence[str], parser: argparse.ArgumentParser) -> int:
    try:
        parsed, unknown = parser.parse_known_args(arguments)
        if unknown:
            parsed.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
        status = int(parsed.run(parsed))
        note_virtual_time(getattr(parsed, "target", None) or "")
        return status
    finally:
        sys.stdout.flush()  # `main` handles the BrokenPipeError of a closed reader
