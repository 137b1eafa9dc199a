"""Strings of an SII image, ETG.2010 category 10, numbered in the order of their first use."""

from __future__ import annotations

STRINGS_MAX = 255  # a string number has one byte
LENGTH_MAX = 255  # so has the length of a string


class SiiStrings:
    """Owner of the strings of one image, and of the notes about strings that differ from the file.

    Equal strings share a number, as in Beckhoff's images (EL2004).
    """

    def __init__(self) -> None:
        self.texts: list[str] = []
        self.notes: list[str] = []
        self._numbers: dict[str, int] = {"": 0}

    def number(self, text: str) -> int:
        """Return the number of a string; 0 if it is empty, or if 255 strings exist."""
        known = self._numbers.get(text)
        if known is not None:
            return known
        stored = self._storable(text)
        number = self._numbers.get(stored, 0)
        if not number:
            number = self._append(stored)
        self._numbers[text] = number
        return number

    def _append(self, text: str) -> int:
        if len(self.texts) == STRINGS_MAX:
            self.notes.append(f"the name {text!r} is left out: an SII has at most 255 strings")
            return 0
        self.texts.append(text)
        self._numbers[text] = len(self.texts)
        return len(self.texts)

    def _storable(self, text: str) -> str:
        """Return the string as the SII can store it: Latin-1, at most 255 characters."""
        stored = text.encode("latin-1", "replace").decode("latin-1")
        if stored != text:
            self.notes.append(f"the name {text!r} is written as {stored!r}: an SII uses Latin-1")
        if len(stored) > LENGTH_MAX:
            self.notes.append(f"the name {stored[:40]!r}… is truncated to 255 characters")
        return stored[:LENGTH_MAX]
