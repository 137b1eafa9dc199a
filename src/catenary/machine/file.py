"""Machine file after reading, with its tables and the line numbers for errors."""

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
from catenary.machine.schema import FORMAT, MachineTables, Table
from catenary.machine.units import Dimension, to_si
from catenary.target import TomlFile, parse, read_toml, target_of
from catenary.toml_lines import KeyPath, key_lines, line_of


class MachineFile:
    """Tables of a machine file, and the line number of every key."""

    def __init__(self, file: TomlFile) -> None:
        """Convert a TOML file into tables.

        Raises:
            MachineFileError: A key or a value is not valid. The error names the line.
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
        """Return the link source of the key `target`.

        Raises:
            MachineFileError: The key is missing, or its value is not a valid target.
        """
        target = target_of(self._toml)
        try:
            return parse(target)
        except ConfigurationError as error:
            raise self.error(("target",), error.message, hint=error.hint) from error

    def error(self, path: KeyPath, message: str, *, hint: str = "") -> MachineFileError:
        """Return the error for a key.

        Args:
            path: path of the key.
            message: text of the error.
            hint: what to do next.
        """
        return MachineFileError(
            message,
            path=str(self.path),
            line=line_of(self._lines, path),
            key=dotted(path) or None,
            hint=hint,
        )

    @contextmanager
    def located(self, path: KeyPath, keys: Iterable[str] = ()) -> Iterator[None]:
        """Convert a TypeError or ValueError in the block into a MachineFileError with a line.

        Args:
            path: path of the value or of its table.
            keys: keys of the table. The first key in the text of the error determines the line.
        """
        try:
            yield
        except (TypeError, ValueError) as error:
            found = re.search(rf"\b({'|'.join(keys)})\b", str(error)) if keys else None
            place = (*path, found[1]) if found is not None else path
            raise self.error(place, str(error)) from error

    def values(self, table: Table, path: KeyPath, *, linear: bool = False) -> dict[str, Any]:
        """Return the values in a table by key, with quantities in SI units.

        Args:
            table: the table.
            path: path of the table.
            linear: True if the quantities belong to a linear axis.

        Raises:
            MachineFileError: A quantity is not a number, or its unit is missing or wrong.
        """
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
        """Raise MachineFileError for another format, before its keys cause other errors."""
        if isinstance(found, str) and found != FORMAT:
            raise self.error(
                ("format",),
                f'this version of Catenary cannot read the format "{found}"',
                hint=f'expected "{FORMAT}"; a newer format needs a newer version of Catenary',
            )


def dotted(path: KeyPath) -> str:
    """Return a path as text, such as `drives.arm.velocity_limit[2]`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def load(path: str | Path) -> MachineFile:
    """Read the tables of a machine file, without a check of the references between them.

    Raises:
        MachineFileError: The file cannot be read, or a key or a value is not valid.
    """
    return MachineFile(read_toml(path))
