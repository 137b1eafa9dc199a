"""The parser accepts every command line in the documents."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from textwrap import indent

import pytest

from benchmarks.cli import main as benchmarks
from catenary.cli import main as catenary

ROOT = Path(__file__).resolve().parent.parent.parent
DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
FENCE = re.compile(r"^```(?:bash|console|sh)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CALL = re.compile(
    r"(?:^ {4}(?:\$ )?|`)(?:sudo )?(?:\.venv/bin/)?(catenary|python -m benchmarks) ([^`\n]+)",
    re.MULTILINE,
)
PARSERS = {"catenary": catenary.make_parser, "python -m benchmarks": benchmarks.make_parser}
PLACEHOLDER = re.compile(r"[\[|]|\b(COMMAND|TARGET|POSITION|FILE|NAME|N|S)\b")
BEHIND = re.compile(r"\s{2,}| \\?\| | > | && |\s#|&$")  # a comment or shell syntax


def calls() -> Iterator[tuple[str, str]]:
    """Return complete command lines, without bare command names and placeholders."""
    for document in DOCUMENTS:
        text = FENCE.sub(lambda block: indent(block[1], " " * 4), document.read_text())
        for program, found in CALL.findall(text):
            call = BEHIND.split(found)[0].strip()
            given = [word for word in call.split() if not word.isalpha()]
            if given and not PLACEHOLDER.search(call):
                yield program, call


@pytest.mark.parametrize(("program", "call"), sorted(set(calls())))
def test_the_parser_accepts_the_command(
    program: str, call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)  # the parser checks the folders of result files
    PARSERS[program]().parse_args(shlex.split(call))
