"""Mapping of names to drives, process data and devices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import TypeVar

V = TypeVar("V")


class ByName(Mapping[str, V]):
    """Objects of a machine by their names in the file.

    The mapping does not contain the objects of absent devices. The KeyError for such an object
    names the absent device.
    """

    def __init__(self, kind: str, found: Mapping[str, V], absent: Mapping[str, str]) -> None:
        self._kind = kind
        self._found = dict(found)
        self._absent = dict(absent)

    def __getitem__(self, name: str) -> V:
        """Return the object with this name.

        Raises:
            KeyError: The file does not contain the name, or its device is absent.
        """
        if name in self._found:
            return self._found[name]
        if name in self._absent:
            raise MissingName(f'{self._kind} "{name}" is absent: {self._absent[name]}')
        near = get_close_matches(name, self._found, n=1)
        guess = f'; did you mean "{near[0]}"?' if near else ""
        known = f"; known names are {', '.join(self._found)}" if self._found else ""
        raise MissingName(f'the file has no {self._kind} "{name}"{guess or known}')

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        return f"<{self._kind}: {', '.join(self._found) or 'none'}>"


class MissingName(KeyError):
    """KeyError for an unknown name. Unlike KeyError, its text has no additional quotes."""

    def __str__(self) -> str:
        return str(self.args[0])
