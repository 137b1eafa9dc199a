"""Every command line in the documents is one that the parser takes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.cli import main as benchmarks
from catenary.cli import main as catenary

ROOT = Path(__file__).resolve().parent.parent.parent
DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
CALL = re.compile(
    r"(?:^ {4}|`)(?:sudo )?(?:\.venv/bin/)?(catenary|python -m benchmarks) ([^`\n]+)", re.MULTILINE
)
PARSERS = {"catenary": catenary.make_parser, "python -m benchmarks": benchmarks.make_parser}
PLACEHOLDER = re.compile(r"[\[|]|\b(COMMAND|TARGET|POSITION|FILE|NAME|N|S)\b")
BEHIND = re.compile(r"\s{2,}| \\?\| | && |\s#|&$")  # a comment, or what a shell does with it


def calls() -> Iterator[tuple[str, str]]:
    """Whole ones: neither a command's name alone nor one with something to put in."""
    for document in DOCUMENTS:
        for program, found in CALL.findall(document.read_text()):
            call = BEHIND.split(found)[0].strip()
            given = [word for word in call.split() if not word.isalpha()]
            if given and not PLACEHOLDER.search(call):
                yield program, call


@pytest.mark.parametrize(("program", "call"), sorted(set(calls())))
def test_it_parses(program: str, call: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)  # where results go is looked at
    PARSERS[program]().parse_args(shlex.split(call))
