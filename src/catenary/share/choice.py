"""Names of operating modes and presets, with their checks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

import msgspec

Kind: TypeAlias = Literal["mode", "preset"]
Names: TypeAlias = Sequence[str] | Mapping[str, str]  # or description by name

CHOICES_MAX = 32
DESCRIPTION_MAX = 120  # characters
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_. -]{0,30}[A-Za-z0-9_]|[A-Za-z0-9]")


class Choice(msgspec.Struct, frozen=True):
    """Operating mode or preset that a program offers to operators."""

    name: str
    description: str = ""


def make_choices(kind: Kind, names: Names) -> tuple[Choice, ...]:
    """Return the operating modes or presets of a program.

    Args:
        kind: "mode" or "preset", for messages.
        names: names, or description by name.

    Raises:
        TypeError: the names are a single text, or a name or description is not a text.
        ValueError: a name or description is invalid, two names are equal, or there are too many.
    """
    if isinstance(names, str):
        raise TypeError(f"{kind}s={names!r}: must be a sequence of names, such as ({names!r},)")
    described = names if isinstance(names, Mapping) else dict.fromkeys(names, "")
    if len(described) != len(names):
        raise ValueError(f"{kind}s={tuple(names)!r}: two names are equal")
    if len(described) > CHOICES_MAX:
        raise ValueError(f"{len(described)} {kind}s; at most {CHOICES_MAX} are possible")
    return tuple(_make_choice(kind, *each) for each in described.items())


def _make_choice(kind: Kind, name: str, description: str) -> Choice:
    if not isinstance(name, str) or not isinstance(description, str):
        raise TypeError(f"{kind} {name!r}: name and description must be texts")
    if NAME.fullmatch(name) is None:
        raise ValueError(
            f"{kind} {name!r}: a name has 1 to 32 letters, digits, spaces and the characters "
            "'_', '.', '-'; it begins and ends with a letter or a digit"
        )
    if len(description) > DESCRIPTION_MAX or not description.isprintable():
        raise ValueError(
            f"description of {kind} {name!r}: at most {DESCRIPTION_MAX} printable characters"
        )
    return Choice(name, description)
