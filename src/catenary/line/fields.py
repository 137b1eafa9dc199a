"""Checked access to the tables of a TOML file. Every error names the file and the line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator

from catenary.errors import CloneError
from catenary.toml_lines import KeyPath, key_lines, line_of

FORMAT = 1
EDITED = "correct the line, or clone the segment again"
_PLACE = re.compile(r"\s*\(at (?:line (\d+), column \d+|end of document)\)")


class Document:
    """Text of a TOML file, its content, and the line numbers of its keys."""

    def __init__(self, file: str, text: str) -> None:
        """Parse a text.

        Args:
            file: Name of the file, for errors.
            text: Its text.

        Raises:
            CloneError: The text is not TOML.
        """
        self.file = file
        try:
            self.content = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            found = _PLACE.search(str(error))
            line = int(found[1]) if found and found[1] else text.count("\n") + 1
            message = _PLACE.sub("", str(error))
            raise CloneError(f"not TOML: {message}", file=file, line=line, hint=EDITED) from error
        except RecursionError as error:
            raise CloneError("the TOML is nested too deeply", file=file, hint=EDITED) from error
        self._lines = key_lines(text)

    def root(self) -> Fields:
        """Return the top-level table. Raises CloneError if the format is not supported."""
        root = Fields(self, (), self.content)
        found = root.number("format", 0, 0xFFFF)
        if found != FORMAT:
            raise root.error(
                "format",
                f"format {found} cannot be read; this version of Catenary reads {FORMAT}",
                hint="a newer format needs a newer version of Catenary",
            )
        return root

    def error(self, path: KeyPath, message: str, hint: str = EDITED) -> CloneError:
        """Return the error for a key.

        Args:
            path: Path of the key.
            message: Text of the error.
            hint: What to do next.
        """
        return CloneError(message, file=self.file, line=line_of(self._lines, path), hint=hint)


class Fields:
    """One table of a document. Each method returns a value after a check of type and range."""

    def __init__(self, document: Document, path: KeyPath, table: dict[str, object]) -> None:
        self._document = document
        self._path = path
        self._table = table

    def __contains__(self, key: str) -> bool:
        return key in self._table

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the table, in the order of the file."""
        return tuple(self._table)

    def only(self, known: Collection[str]) -> None:
        """Raise CloneError if the table has another key than these."""
        for key in self._table:
            if key not in known:
                raise self.error(key, f"unknown key {key!r}; known keys: {', '.join(known)}")

    def error(
        self, key: str, message: str, *, element: int | None = None, hint: str = EDITED
    ) -> CloneError:
        """Return the error for a key of this table.

        Args:
            key: The key.
            message: Text of the error.
            element: Element of the list at the key; None for the key itself.
            hint: What to do next.
        """
        place = (key,) if element is None else (key, element)
        return self._document.error((*self._path, *place), message, hint)

    def number(self, key: str, lowest: int, highest: int) -> int:
        """Return an integer.

        Args:
            key: The key.
            lowest: Smallest valid value.
            highest: Largest valid value.
        """
        value = self._value(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self._type(key, value, "an integer")
        if not lowest <= value <= highest:
            raise self.error(key, f"{key} = {value} is out of range ({lowest} to {highest})")
        return value

    def flag(self, key: str) -> bool:
        """Return true or false."""
        value = self._value(key)
        if not isinstance(value, bool):
            raise self._type(key, value, "true or false")
        return value

    def text(self, key: str) -> str:
        """Return a text."""
        value = self._value(key)
        if not isinstance(value, str):
            raise self._type(key, value, "text")
        return value

    def data(self, key: str) -> bytes:
        """Return bytes, which are hexadecimal text in the file."""
        text = self.text(key)
        try:
            return bytes.fromhex(text)
        except ValueError as error:
            raise self.error(key, f"{key}: not hexadecimal bytes: {error}") from error

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of texts."""
        value = self._value(key)
        if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
            raise self._type(key, value, "a list of texts")
        return tuple(value)

    def table(self, key: str) -> Fields:
        """Return a table inside this table; an empty one if it is missing."""
        value = self._table.get(key, {})
        if not isinstance(value, dict):
            raise self._type(key, value, "a table")
        return Fields(self._document, (*self._path, key), value)

    def tables(self, key: str) -> Iterator[Fields]:
        """Yield the tables of a list; none if it is missing."""
        value = self._table.get(key, [])
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            raise self._type(key, value, "a list of tables")
        for number, each in enumerate(value):
            yield Fields(self._document, (*self._path, key, number), each)

    def _value(self, key: str) -> object:
        if key not in self._table:
            raise self._document.error(self._path, f"key {key!r} is missing")
        return self._table[key]

    def _type(self, key: str, value: object, expected: str) -> CloneError:
        return self.error(key, f"{key} must be {expected}, not {type(value).__name__}")
