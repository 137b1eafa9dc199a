"""The messages that the pages quote are those of the source."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("docs/troubleshooting.md", "docs/reference/errors.md", "docs/reference/events.md")
CELL = re.compile(r"^\| ((?:[^|`]|`[^`]*`)*) \|", re.MULTILINE)  # the first of a row
VALUE = re.compile(  # a part of a message that stands for any name or number
    r"\.\.\.|'[^']*'|\[rad/s\]|0x[0-9A-F]+|\b\d[\d.]*\b|\b(?:shoulder|eth0|device|in|to)\b|[(),:;]"
)
SHORTEST = 10  # of a text that is looked up


@cache
def source() -> str:
    texts = []
    for path in (ROOT / "src/catenary").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    texts += [path.read_text() for path in (ROOT / "src/catenary").rglob("*.pyx")]
    return " ".join("\n".join(texts).split())


def messages() -> list[tuple[str, str]]:
    return [
        (page, text)
        for page in PAGES
        for cell in CELL.findall((ROOT / page).read_text())
        for text in re.findall(r"`([^`]+ [^`]+)`", cell)
    ]


@pytest.mark.parametrize(("page", "message"), messages())
def test_the_message_is_in_the_source(page: str, message: str) -> None:
    parts = [part.strip() for part in VALUE.split(message)]
    unknown = [part for part in parts if len(part) >= SHORTEST and part not in source()]
    assert unknown == []
