"""Escaping of device text for a terminal."""

from __future__ import annotations


def escaped(text: str) -> str:
    r"""Return the text with unprintable characters escaped, such as `"\x1b[2J"`.

    Device names, object names and strings come from EEPROMs and dictionaries. Escape sequences in
    them could clear the terminal, and a line break could imitate the output of this program.
    """
    return "".join(c if c.isprintable() else _escape(c) for c in text)


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
