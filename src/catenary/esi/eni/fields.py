"""Strict reading of elements: an ENI is executed, so a faulty value is an error, not a warning."""

from __future__ import annotations

from typing import Never

from catenary.errors import MachineFileError
from catenary.esi.eni.known import Known
from catenary.esi.source import EsiWarning, Source
from catenary.esi.values import BLANK, HEX_PREFIX, parse_flag, parse_number, plain_text, shown
from catenary.esi.xml import Element

WARNINGS_MAX = 100
ENCRYPTED_HINT = (
    "the root is EncryptedEtherCATConfig, so this content may be scrambled; export the ENI "
    "without encryption"
)


class Fields:
    """Strict reader of one file. It owns the list of warnings."""

    def __init__(self, file: str, *, encrypted: bool = False) -> None:
        self.file = file
        self.encrypted = encrypted
        self.warnings: list[EsiWarning] = []

    def source(self, element: Element) -> Source:
        """Return the place of an element."""
        return Source(self.file, element.line)

    def refuse(self, element: Element, message: str, *, tag: str = "", hint: str = "") -> Never:
        """Raise the error for an element, or for its child or attribute with a tag.

        Many files have all elements in one line, so the error also has the name of the element.
        """
        child = element.find(tag)
        line = element.line if child is None else child.line
        name = self._name(element)
        key = "/".join(filter(None, (f"{element.tag} {shown(name)}" if name else element.tag, tag)))
        given = hint or (ENCRYPTED_HINT if self.encrypted else "")
        raise MachineFileError(message, path=self.file, line=line, key=key, hint=given)

    def _name(self, element: Element) -> str:
        """Return the name or comment of an element; empty if it has neither."""
        for path in ("Name", "Info/Name", "Comment", "Index"):
            found = element.at(path)
            if found is not None and found.text.strip():
                return found.text
        return ""

    def warn(self, element: Element, message: str) -> None:
        """Add a warning; further ones are dropped when there are too many."""
        if len(self.warnings) < WARNINGS_MAX:
            self.warnings.append(EsiWarning(self.source(element), message))

    def child(self, parent: Element, tag: str) -> Element:
        """Return the child with a tag. Raise MachineFileError if it is missing."""
        found = parent.find(tag)
        if found is None:
            self.refuse(parent, f"{parent.tag} has no {tag}")
        return found

    def number(
        self, parent: Element, tag: str, *, bits: int = 32, default: int | None = None
    ) -> int:
        """Return the number in a child, or in an attribute "@NAME".

        Args:
            parent: The parent.
            tag: The tag of the child, or "@" and the name of an attribute.
            bits: The width of the number.
            default: The value without a child; None if the child is required.

        Raises:
            MachineFileError: The number is missing, is not a number, or is too large.
        """
        text = self._text(parent, tag)
        if not text:
            if default is None:
                self.refuse(parent, f"{parent.tag} has no {tag}")
            return default
        try:
            value, remark = parse_number(text)
        except ValueError as error:
            self.refuse(parent, str(error), tag=tag)
        if remark:
            self.refuse(
                parent, f"{shown(text)} is not a number; hexadecimal numbers begin with #x", tag=tag
            )
        if not 0 <= value < 1 << bits:
            self.refuse(parent, f"{shown(text)} does not fit into {bits} bits", tag=tag)
        return value

    def signed(self, parent: Element, tag: str, *, bits: int = 32, default: int = 0) -> int:
        """Return the number in a child, which may be negative."""
        text = self._text(parent, tag)
        if not text.startswith("-"):
            return self.number(parent, tag, bits=bits, default=default)
        try:
            value = parse_number(text).value
        except ValueError as error:
            self.refuse(parent, str(error), tag=tag)
        if value < -(1 << bits - 1):
            self.refuse(parent, f"{shown(text)} does not fit into {bits} bits", tag=tag)
        return value

    def flag(self, parent: Element, tag: str) -> bool:
        """Return the boolean in a child or attribute "@NAME"; False if it is missing."""
        text = self._text(parent, tag)
        try:
            return parse_flag(text)
        except ValueError as error:
            self.refuse(parent, str(error), tag=tag)

    def data(self, parent: Element, tag: str) -> bytes | None:
        """Return the hexadecimal data in a child; None without this child."""
        found = parent.find(tag)
        if found is None:
            return None
        digits = BLANK.sub("", found.text)
        prefix = HEX_PREFIX.match(digits)
        digits = digits[prefix.end() :] if prefix else digits
        try:
            return bytes.fromhex(digits)
        except ValueError:
            self.refuse(parent, f"{shown(found.text)} is not hexadecimal data", tag=tag)

    def text(self, parent: Element, tag: str, *, required: bool = False) -> str:
        """Return the text of a child in one line; empty if it is missing and not required."""
        text = self._text(parent, tag)
        if required and not text:
            self.refuse(parent, f"{parent.tag} has no {tag}")
        return text

    def check_known(self, element: Element, known: Known, path: str = "") -> None:
        """Warn about elements that the reader does not know; each path once."""
        seen: set[str] = set()
        self._check(element, known, path or element.tag, seen)

    def _check(self, element: Element, known: Known, path: str, seen: set[str]) -> None:
        for child in element.children:
            place = f"{path}/{child.tag}"
            if child.tag not in known:
                if place not in seen:
                    seen.add(place)
                    self.warn(child, f"unknown element {place}; ignored")
                continue
            below = known[child.tag]
            if below is not None:
                self._check(child, below, place, seen)

    def _text(self, parent: Element, tag: str) -> str:
        if tag.startswith("@"):
            return plain_text(parent.attributes.get(tag[1:], ""))
        found = parent.find(tag)
        return "" if found is None else plain_text(found.text)
