"""Findings of the ESI reader: warnings, and values that it reads with a warning for each fault."""

from __future__ import annotations

from catenary.esi.source import EsiWarning, Source
from catenary.esi.values import chosen_text, parse_data, parse_flag, parse_number, plain_text, shown
from catenary.esi.xml import Element

WARNINGS_MAX = 1000  # per device; a broken generator produces one for each object


class Findings:
    """Warnings about one device or file. It owns the list of warnings."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.warnings: list[EsiWarning] = []

    def source(self, element: Element) -> Source:
        """Return the place of an element."""
        return Source(self.file, element.line)

    def warn(self, element: Element, message: str) -> None:
        """Add a warning.

        Args:
            element: The faulty element.
            message: The fault, and the reaction to it.
        """
        if len(self.warnings) < WARNINGS_MAX:
            self.warnings.append(EsiWarning(self.source(element), message))
        elif len(self.warnings) == WARNINGS_MAX:
            self.warnings.append(EsiWarning(self.source(element), "further warnings are omitted"))

    def number(
        self, element: Element | None, attribute: str = "", *, bits: int = 32, signed: bool = False
    ) -> int | None:
        """Return the number in an element or attribute; None if it is missing or faulty.

        Args:
            element: The element; None if the file does not have it.
            attribute: The attribute; empty for the text of the element.
            bits: The width of the number.
            signed: True if the number may be negative.
        """
        if element is None:
            return None
        text = element.attributes.get(attribute, "") if attribute else element.text
        if not text or text.isspace():
            return None
        what = f"{element.tag}/@{attribute}" if attribute else element.tag
        try:
            value, remark = parse_number(text)
        except ValueError as error:
            self.warn(element, f"{what}: {error}; ignored")
            return None
        if not (-(1 << bits - 1) if signed else 0) <= value < 1 << bits:
            self.warn(element, f"{what}: {shown(text)} does not fit into {bits} bits; ignored")
            return None
        if remark:
            self.warn(element, f"{what}: {remark}")
        return value

    def integer(
        self,
        element: Element | None,
        attribute: str = "",
        *,
        default: int = 0,
        bits: int = 32,
        signed: bool = False,
    ) -> int:
        """Return the number in an element or attribute; a default if it is missing or faulty.

        Args:
            element: The element; None if the file does not have it.
            attribute: The attribute; empty for the text of the element.
            default: The value without a number in the file.
            bits: The width of the number.
            signed: True if the number may be negative.
        """
        value = self.number(element, attribute, bits=bits, signed=signed)
        return default if value is None else value

    def required(
        self, element: Element, tag: str, *, bits: int = 32, reaction: str = "ignored"
    ) -> int | None:
        """Return the number in a child; warn and return None if it is missing.

        Args:
            element: The parent.
            tag: The tag of the child.
            bits: The width of the number.
            reaction: The consequence of a missing number.
        """
        child = element.find(tag)
        if child is None or not child.text.strip():
            self.warn(element, f"{element.tag} has no {tag}; {reaction}")
            return None
        return self.number(child, bits=bits)

    def flag(self, element: Element | None, attribute: str = "", default: bool = False) -> bool:
        """Return the boolean in an element or attribute.

        Args:
            element: The element; None if the file does not have it.
            attribute: The attribute; empty for the text of the element.
            default: The value if it is missing or faulty.
        """
        if element is None or (attribute and attribute not in element.attributes):
            return default
        try:
            return parse_flag(element.attributes[attribute] if attribute else element.text)
        except ValueError as error:
            what = f"{element.tag}/@{attribute}" if attribute else element.tag
            self.warn(element, f"{what}: {error}; read as {default}")
            return default

    def data(self, element: Element | None) -> bytes | None:
        """Return the hexadecimal data in an element; None if they are missing or faulty."""
        if element is None:
            return None
        try:
            data, remark = parse_data(element.text)
        except ValueError as error:
            self.warn(element, f"{element.tag}: {error}; ignored")
            return None
        if remark:
            self.warn(element, f"{element.tag}: {remark}")
        return data


def text_of(element: Element | None, tag: str) -> str:
    """Return the text of a child in the preferred language, in one line; empty without one.

    Args:
        element: The parent; None if the file does not have it.
        tag: The tag of the child.
    """
    found = [child for child in element.children if child.tag == tag] if element else []
    if len(found) < 2:
        return plain_text(found[0].text) if found else ""
    return chosen_text((child.attributes, child.text) for child in found)
