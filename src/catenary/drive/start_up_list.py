"""Start-up list of TwinCAT as StartUp objects."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path

from catenary.errors import MachineFileError
from catenary.esi.eni import MailboxCommand, read_start_up_list
from catenary.esi.eni.commands import DOWNLOAD
from catenary.plan.start_up_object import MAPPING_OBJECTS, StartUp

IN_PRE_OP = frozenset(("IP", "PS"))


def read_start_up(path: str | Path) -> list[StartUp]:
    """Return the objects of a start-up list that TwinCAT exported as XML.

        arm = cat.Drives(subs, start_up=cat.drive.read_start_up("drive.xml"), counts_per_turn=2**20)

    Objects before the PDO mapping in the file have `before_mapping=True`. Values are bytes and are
    not read back, as in TwinCAT. These commands are left out, with a RuntimeWarning: those of the
    PDO mapping, which `pdos=` of the request writes, disabled ones, and those of downward
    transitions.

    Args:
        path: XML file of one device: page "Startup", "Export to XML".

    Raises:
        MachineFileError: The file cannot be read, a value is faulty, or it has a command that a
            StartUp cannot express: SoE, an upload, or the transition SO. The error names file, line
            and element.
    """
    commands = read_start_up_list(path)
    for command in commands:
        _check(command, str(path))
    mapping = [number for number, each in enumerate(commands) if _is_mapping(each)]
    first = min(mapping, default=0)
    kept = [number for number, each in enumerate(commands) if _is_written(each)]
    _warn(path, [each for each in commands if not _is_written(each)])
    return [start_up(commands[number], before_mapping=number < first) for number in kept]


def start_up(command: MailboxCommand, *, before_mapping: bool) -> StartUp:
    """Return a CoE command as a start-up object.

    Args:
        command: the command.
        before_mapping: True to write it before the mapping.
    """
    object_ = command.download
    assert object_ is not None
    return StartUp(
        object_.index,
        object_.subindex,
        object_.data,
        before_mapping=before_mapping,
        verify=False,
        complete_access=object_.complete_access,
    )


def is_mapping_object(index: int) -> bool:
    """Return True if an object belongs to the PDO mapping."""
    return any(index in objects for objects in MAPPING_OBJECTS)


def _is_written(command: MailboxCommand) -> bool:
    in_pre_op = not IN_PRE_OP.isdisjoint(command.transitions)
    return in_pre_op and not command.disabled and not _is_mapping(command)


def _is_mapping(command: MailboxCommand) -> bool:
    return command.download is not None and is_mapping_object(command.download.index)


def _check(command: MailboxCommand, path: str) -> None:
    """Raise MachineFileError for a command that a StartUp cannot express."""
    if command.disabled:
        return
    place = f"{command.protocol}/InitCmds/InitCmd"
    place += f" ({command.comment})" * bool(command.comment)
    if command.protocol != "CoE":
        what = f"{command.parameter}: " if command.parameter else ""
        message = f"{what}{command.protocol} is not supported; only CoE objects can be written"
    elif command.operation != DOWNLOAD:
        message = f"Ccs {command.operation} is not supported; only downloads (Ccs 1)"
    elif "SO" in command.transitions:
        message = "the transition SO is not supported; start-up objects are written in PRE-OP"
    elif command.download is not None and _is_too_deep(command):
        message = "complete access begins at subindex 0 or 1"
    else:
        return
    raise MachineFileError(
        message,
        path=path,
        line=command.source.line,
        key=place,
        hint="disable the command in TwinCAT, or remove it from the file",
    )


def _is_too_deep(command: MailboxCommand) -> bool:
    object_ = command.download
    return object_ is not None and object_.complete_access and object_.subindex > 1


def _warn(path: str | Path, left_out: Sequence[MailboxCommand]) -> None:
    if not left_out:
        return
    warnings.warn(
        f"{path}: {len(left_out)} commands are left out: {', '.join(_reasons(left_out))}",
        RuntimeWarning,
        stacklevel=3,
    )


def _reasons(left_out: Iterable[MailboxCommand]) -> list[str]:
    found: dict[str, int] = {}
    for each in left_out:
        if each.disabled:
            reason = "disabled"
        elif _is_mapping(each):
            reason = "of the PDO mapping (use pdos=)"
        else:
            reason = f"at {', '.join(each.transitions)}"
        found[reason] = found.get(reason, 0) + 1
    return [f"{count} {reason}" for reason, count in found.items()]
