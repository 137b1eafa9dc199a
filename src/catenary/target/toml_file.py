"""Reading of TOML files, with errors that name the file and the line."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from catenary.errors import MachineFileError

VIRTUAL = ("virtual", "virtual-realtime")  # targets that may name the file of a segment
LINE_MAX = 200  # characters of a line in an error
_PLACE = re.compile(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)")


@dataclass(frozen=True, slots=True)
class TomlFile:
    """The text of a TOML file and its content."""

    path: Path
    text: str
    content: dict[str, object]


def read_toml(path: str | Path) -> TomlFile:
    """Read a TOML file.

    Raises:
        MachineFileError: The file cannot be opened, is not UTF-8, or is not TOML.
    """
    where = Path(path)
    try:
        text = where.read_bytes().decode("utf-8-sig")
    except OSError as error:
        hint = "create a file: catenary init TARGET -o machine.toml"
        raise _unreadable(where, error.strerror or str(error), hint=hint) from error
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        byte = f"byte 0x{error.object[error.start]:02X}"
        hint = "save the file as UTF-8"
        raise _unreadable(where, f"not UTF-8 text: {byte}", line, hint=hint) from error
    try:
        return TomlFile(where, text, tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        message, line = _parts(str(error), text)
        raise _unreadable(where, f"not TOML: {message}", line, hint=_hint(text, line)) from error
    except RecursionError as error:
        raise _unreadable(where, "the TOML is nested too deeply") from error


def target_of(file: TomlFile) -> str:
    """Return the `target` that a machine file names.

    In the file, the path of a virtual segment is relative to the folder of the machine file.

    Raises:
        MachineFileError: The file has no target, or an invalid one.
    """
    target = file.content.get("target")
    if not isinstance(target, str) or not target.strip():
        fault = 'key "target" is missing' if target is None else f"target = {target!r} is not text"
        raise _unreadable(file.path, fault, hint='write target = "eth0" at the top of the file')
    kind, _, name = target.strip().partition(":")
    if kind in VIRTUAL and name:
        return f"{kind}:{file.path.parent / name}"
    if is_machine_file(target):
        raise _unreadable(
            file.path,
            f"target = {target!r} is another machine file",
            hint='write a network interface: target = "eth0"',
        )
    return target


def is_machine_file(target: str) -> bool:
    """Return True if a target is a machine file: *.toml, but not `virtual:FILE.toml`."""
    name = target.strip()
    kind, colon, _ = name.partition(":")
    return name.endswith(".toml") and not (colon and kind in VIRTUAL)


def _unreadable(
    path: Path, message: str, line: int | None = None, *, hint: str = ""
) -> MachineFileError:
    return MachineFileError(message, path=str(path), line=line, hint=hint)


def _parts(message: str, text: str) -> tuple[str, int]:
    """Return the message of `tomllib` without the position, and the line."""
    found = _PLACE.search(message)
    line = int(found[1]) if found is not None and found[1] else text.count("\n") + 1
    return _PLACE.sub("", message), line


def _hint(text: str, line: int) -> str:
    if text.lstrip("\ufeff \r\n\t").startswith("<"):
        return "this is an XML file; convert an ENI with `catenary init bus.xml -o machine.toml`"
    content = "".join(text.splitlines()[line - 1 : line]).strip()
    more = " ..." if len(content) > LINE_MAX else ""
    return f"the line is: {content[:LINE_MAX]}{more}" if content else ""
