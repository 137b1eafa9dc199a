"""Programs of this folder are short: a common task takes at most 20 lines of code."""

from __future__ import annotations

from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
PROGRAMS = sorted(
    path.name for path in HERE.glob("*.py") if not path.name.startswith(("test_", "conftest", "__"))
)


def code_lines(text: str) -> list[str]:
    """Return the lines that are neither empty nor only a comment."""
    lines = (line.strip() for line in text.splitlines())
    return [line for line in lines if line and not line.startswith("#")]


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_has_at_most_20_lines_of_code(name: str) -> None:
    assert len(code_lines((HERE / name).read_text())) <= 20
