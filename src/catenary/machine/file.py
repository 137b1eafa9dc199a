"""A machine file that has been read: its tables, and the lines that errors name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import msgspec
from msgspec import UNSET

from catenary.errors import ConfigurationError, MachineFileError
from catenary.link import LinkSource
from catenary.machine.explanation import explain, quantities
from catenary.machine.lines import KeyPath, key_lines, line_of
from catenary.machine.schema import FORMAT, MachineTables, Table
from catenary.machine.units import Dimension, to_si
from catenary.target import TomlFile, parse, read_toml, target_of


class MachineFile:
    """The tables of a machine file, and the line of every key."""

    def __init__(self, file: TomlFile) -> None:
        """Convert a TOML file.

        Raises:
            MachineFileError: A key or a value is wrong; it names the line.
        """
        self.path = file.path
        self._toml = file
        self._lines = key_lines(file.text)
        self._check_format(file.content.get("format"))
        try:
            self.tables = msgspec.convert(file.content, MachineTables)
        except msgspec.ValidationError as error:
            found = explain(error, file.content)
            raise self.error(found.path, found.message, hint=found.hint) from None

    def source(self) -> LinkSource:
        """Return the link source of `target`.

        Raises:
            MachineFileError: The file names none, or one that cannot be.
        """
        target = target_of(self._toml)
        try:
            return parse(target)
        except ConfigurationError as error:
            raise self.error(("target",), error.message, hint=error.hint) from error

    def error(self, path: KeyPath, message: str, *, hint: str = "") -> MachineFileError:
        """Return the error for a key."""
        return MachineFileError(
            message,
            path=str(self.path),
            line=line_of(self._lines, path),
            key=dotted(path) or None,
            hint=hint,
        )

    @contextmanager
    def located(self, path: KeyPath, keys: Iterable[str] = ()) -> Iterator[None]:
        """Turn a ValueError into an error with a line.

        Args:
            path: Place of the value, or of its table.
            keys: Keys of the table; the first one in the text of the error is the place.
        """
        try:
            yield
        except (TypeError, ValueError) as error:
            found = re.search(rf"\b({'|'.join(keys)})\b", str(error)) if keys else None
            place = (*path, found[1]) if found is not None else path
            raise self.error(place, str(error)) from error

    def values(self, table: Table, path: KeyPath, *, linear: bool = False) -> dict[str, Any]:
        """Return the keys that are given in a table, quantities in SI units."""
        return {
            name: self._value(getattr(table, name), dimension, (*path, name), linear)
            for name, dimension in quantities(type(table)).items()
            if getattr(table, name) is not UNSET
        }

    def _value(self, given: Any, dimension: str | None, path: KeyPath, linear: bool) -> Any:
        if dimension is None:
            return given
        if isinstance(given, list):
            return [self._value(v, dimension, (*path, i), linear) for i, v in enumerate(given)]
        with self.located(path):
            return to_si(given, cast(Dimension, dimension), linear=linear)

    def _check_format(self, found: object) -> None:
        """Check the format first: another version has other keys."""
        if isinstance(found, str) and found != FORMAT:
            raise self.error(
                ("format",),
                f'"{found}" is not a format that this version of Catenary reads',
                hint=f'expected "{FORMAT}"; a newer format needs a newer Catenary',
            )


def dotted(path: KeyPath) -> str:
    """Return a path as text: `drives.arm.velocity_limit[2]`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def load(path: str | Path) -> MachineFile:
    """Read the tables of a machine file; references between them are not checked."""
    return MachineFile(read_toml(path))
