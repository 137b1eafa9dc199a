"""Types of signatures as the sources write them, not as Python expands them.

numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.float64]]  ->  NDArray[float64]
Sequence[float] | NDArray[float64]                          ->  ArrayLike
LoseFrames | Corrupt | ...                                  ->  Fault
"""

from __future__ import annotations

import re
import sys
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import typing

ANY = r"~?(?:typing\.)?Any"
FLOATS = r"~?numpy\.typing\.NDArray\[~?numpy\.float64\]"
SEQUENCE = r"~?(?:collections\.abc\.)?Sequence\[float\]"
FAULT = r"~?(?:catenary\.virtual\.faults\.)?[A-Z]\w+"
BUFFER = r"~?(?:\w+\.)*_?Buffer"
RULES = {
    rf"{BUFFER} \| ~?(?:\w+\.)*_SupportsArray\[.*?_NestedSequence\[complex \| bytes \| str\]": (
        "~numpy.typing.ArrayLike"
    ),
    rf"(~?)numpy\.ndarray\[tuple\[{ANY}, \.\.\.\], ~?numpy\.dtype\[([^\[\]]*)\]\]": (
        r"\1numpy.typing.NDArray[\2]"
    ),
    rf"{SEQUENCE} \| {FLOATS}|{FLOATS} \| {SEQUENCE}": "~numpy.typing.ArrayLike",
    rf"~?catenary\.virtual\.faults\.LoseFrames(?: \| {FAULT})+": "~catenary.virtual.Fault",
}


def shorten(stringify: Any) -> Any:
    """Return a version of Sphinx's `stringify_annotation` that applies the rules."""

    def wrapper(*args: Any, **options: Any) -> str:
        text = str(stringify(*args, **options))
        for pattern, replacement in RULES.items():
            text = re.sub(pattern, replacement, text)
        return text

    return wrapper


def setup(app: Sphinx) -> dict[str, bool]:
    original = typing.stringify_annotation
    shortened = shorten(original)
    for module in list(sys.modules.values()):
        imported = getattr(module, "stringify_annotation", None)
        if module.__name__.startswith("sphinx.") and imported is original:
            setattr(module, "stringify_annotation", shortened)  # noqa: B010  of a foreign module
    return {"parallel_read_safe": True, "parallel_write_safe": True}
