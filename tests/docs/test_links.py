"""Relative links of Markdown files lead to a file, and to a heading of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(
    [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("tests/*/README.md")],
)
FILES.remove(ROOT / "CHANGELOG.md")  # it links to pages as they were
LINK = re.compile(r"\]\((?!\w+:)([^)#\s]*)(?:#([^)\s]+))?\)")
CODE = re.compile(r"^(`{3,}).*?^\1`*$|`[^`\n]+`", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#+ +(.+?) *$", re.MULTILINE)
LABEL = re.compile(r"^\(([\w-]+)\)=$", re.MULTILINE)


@cache
def anchors(path: Path) -> set[str]:
    """The anchors of a file, as GitHub and MyST make them from headings."""
    text = re.sub(r"^(`{3,}).*?^\1`*$", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
    found = set(LABEL.findall(text))
    for heading in HEADING.findall(text):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        found.add(re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-"))
    return found


def links() -> Iterator[tuple[str, str, str]]:
    for file in FILES:
        text = CODE.sub(lambda code: "\n" * code[0].count("\n"), file.read_text())
        for target, anchor in LINK.findall(text):
            yield str(file.relative_to(ROOT)), target, anchor


@pytest.mark.parametrize(("file", "target", "anchor"), sorted(set(links())))
def test_it_leads_somewhere(file: str, target: str, anchor: str) -> None:
    path = (ROOT / file).parent / target if target else ROOT / file
    assert path.exists()
    if anchor and path.suffix == ".md":
        assert anchor in anchors(path)
