"""Parts of a TOML text: strings, lists and comments from the texts of devices."""

from __future__ import annotations

import json
from collections.abc import Iterable


def quoted(text: str) -> str:
    """Return a TOML string on one line. Characters that TOML excludes are escaped."""
    plain = text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
    return "".join(
        character
        if character.isprintable()
        else f"\\u{ord(character):04x}"
        if ord(character) < 0x10000
        else f"\\U{ord(character):08x}"
        for character in json.dumps(plain, ensure_ascii=False)
    )


def listed(texts: Iterable[str]) -> str:
    """Return a TOML list of strings: on one line if it is empty, else one line per string."""
    lines = [f"    {quoted(each)},\n" for each in texts]
    return f"[\n{''.join(lines)}]" if lines else "[]"


def flag(value: bool) -> str:
    """Return true or false."""
    return "true" if value else "false"


def comment(text: str) -> str:
    """Return a text without characters that would end a comment."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
