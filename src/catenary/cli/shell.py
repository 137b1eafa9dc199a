"""`catenary shell TARGET`: a Python shell with the devices of a target."""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import CodeType
from typing import Any

from catenary.cli import share_target
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_force

CODE_NAME = "<catenary shell -c>"


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "shell",
        help="open a Python shell with the devices of a target",
        description="Brings all devices to PRE-OP and opens a Python shell: IPython, if it is "
        "installed (catenary[shell]). `main` is the MainDevice, `subs` its devices. With "
        "share:NAME, `program` sends requests to the running program. When the shell ends, an "
        "open loop stops its drives, and the devices go to INIT.",
        example="catenary shell eth0\n"
        "catenary shell virtual -c 'print(subs[2].sdo.read(0x1008))'\n"
        "catenary shell share:arm",
    )
    parser.add_argument(
        "target", metavar="TARGET", help="eth0, virtual, share:NAME ... (see catenary --help)"
    )
    parser.add_argument("-c", "--command", metavar="CODE", help="run CODE instead of a shell")
    parser.add_argument("--plain", action="store_true", help="use Python's shell, not IPython")
    add_force(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    code = None
    if arguments.command is not None:
        try:
            code = compile(arguments.command, CODE_NAME, "exec")
        except SyntaxError as error:
            raise UsageError(f"CODE is not Python: {error.msg} (line {error.lineno})") from error
    with names_of(arguments) as (names, banner):
        if code is not None:
            return run_code(code, names)
        if not arguments.plain and find_spec("IPython") is not None:
            run_ipython(names, banner)
        else:
            run_plain(names, banner)
    return 0


def run_code(code: CodeType, names: dict[str, Any]) -> int:
    """Run code. Return 1 after an error, and print the traceback of the code."""
    from catenary.errors import CatenaryError

    try:
        exec(code, names)
    except (CatenaryError, BrokenPipeError):
        raise  # has its own message and exit status
    except Exception as error:
        inner = error.__traceback__
        traceback.print_exception(error.with_traceback(inner.tb_next if inner else None))
        return 1
    return 0


@contextmanager
def names_of(arguments: argparse.Namespace) -> Iterator[tuple[dict[str, Any], str]]:
    """Open the target. Yield the names in the shell, and the banner."""
    import catenary as cat

    names: dict[str, Any] = {"__name__": "__main__", "cat": cat, "types": cat.types}
    if share_target.names_share(arguments.target):
        with share_target.connect_to(arguments.target) as program:
            names |= {"program": program}
            yield names, banner_of(arguments.target, program_names(names))
        return
    from catenary.cli.devices import report_failures
    from catenary.target import MainDevice

    with MainDevice(arguments.target, force=arguments.force) as main:
        subs = main.scan(strict=False)
        report_failures(subs)
        names |= {"main": main, "subs": subs}
        yield names, banner_of(arguments.target, device_names(names))


def device_names(names: Mapping[str, Any]) -> dict[str, str]:
    """Return the explanation of each name, for a target with devices."""
    return {
        "main": "the MainDevice: main.scan(), main.diagnose(), main.events",
        "subs": f"its {len(names['subs'])} devices: subs[0], subs.drives, subs.by_alias(10)",
        "cat": "the package catenary: cat.Drives, cat.Loop",
        "types": "EtherCAT data types: subs[0].sdo.read(0x1018, 1, type=types.UDINT)",
    }


def program_names(names: Mapping[str, Any]) -> dict[str, str]:
    """Return the explanation of each name, for a running program."""
    return {
        "program": "requests to the running program: program.devices(), program.timing()",
        "cat": "the package catenary: cat.attach(NAME) reads the share",
    }


def banner_of(target: str, names: Mapping[str, str]) -> str:
    width = max(map(len, names))
    lines = [f"  {name.ljust(width)}  {text}" for name, text in names.items()]
    return "\n".join([f"Catenary on {target}. Leave with Ctrl-D.", *lines])


def run_ipython(names: dict[str, Any], banner: str) -> None:
    """Run IPython until it ends."""
    config = import_module("traitlets.config").Config()
    config.TerminalInteractiveShell.banner1 = f"{banner}\n"
    config.TerminalInteractiveShell.confirm_exit = False
    import_module("IPython").start_ipython(argv=[], user_ns=names, config=config)


def run_plain(names: dict[str, Any], banner: str) -> None:
    """Run Python's own shell until it ends, with completion if readline is available."""
    import code

    if find_spec("readline") is not None and sys.stdin.isatty():
        completer = import_module("rlcompleter").Completer(names)
        readline = import_module("readline")
        readline.set_completer(completer.complete)
        readline.parse_and_bind("tab: complete")
    code.interact(banner=banner, local=names, exitmsg="")
