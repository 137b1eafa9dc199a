"""Raw figures are in `benchmarks/results/MACHINE/DATE`, and the documents link there."""

from __future__ import annotations

import json
import re
from datetime import date
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"
FILES = sorted(RESULTS.rglob("*.*"))
pytestmark = pytest.mark.skipif(not RESULTS.is_dir(), reason="a source distribution has no results")
LINKS = sorted(
    {
        (document.parent.name, link)
        for document in (ROOT / "docs").glob("*/*.md")
        for link in re.findall(r"\]\((\.\./\.\./benchmarks/[^)#]+)\)", document.read_text())
    }
)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_each_has_a_machine_and_a_date(file: Path) -> None:
    _machine, day, name = file.relative_to(RESULTS).parts
    assert date.fromisoformat(day)
    assert name.endswith(".json")
    found = json.loads(file.read_text())
    assert found["machine"]
    assert found.get("date", day).startswith(day)


def test_the_documents_have_no_raw_figures() -> None:
    assert not list((ROOT / "docs").rglob("*.json"))


@pytest.mark.parametrize(("folder", "link"), LINKS)
def test_links_lead_to_a_result(folder: str, link: str) -> None:
    assert (ROOT / "docs" / folder / link).exists()
