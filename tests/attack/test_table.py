"""Hostile neighbours of docs/explanation/safety.md: each row names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "explanation" / "safety.md").read_text()
SECTION = TEXT.split("## Hostile neighbours")[1].split("\n## ")[0]
ROWS = [line for line in SECTION.splitlines() if line.startswith("| ")]
HEAD = "| neighbour |"


@pytest.mark.parametrize("row", [row for row in ROWS if not row.startswith(HEAD)])
def test_each_row_names_its_tests(row: str) -> None:
    columns = [column.strip() for column in row.strip("|").split("|")]
    assert len(columns) == 4
    assert all(columns)
    named = re.findall(r"`([^`]+)`", columns[3])
    assert named
    for name in named:
        path = ROOT / name if "/" in name else ROOT / "tests" / "scenario" / f"{name}.py"
        assert path.exists(), name


def test_there_are_two_tables() -> None:
    assert sum(row.startswith(HEAD) for row in ROWS) == 2
