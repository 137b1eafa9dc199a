"""The examples of the README and of the documentation run. docs/README.md explains how."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.page import ROOT, run_page

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
NAMES = [
    str(path.relative_to(ROOT))
    for path in PAGES
    if path != ROOT / "docs" / "README.md" and "```python" in path.read_text()
]


@pytest.mark.parametrize("name", NAMES)
def test_the_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "esi_library"))
    assert run_page(ROOT / name, monkeypatch)
