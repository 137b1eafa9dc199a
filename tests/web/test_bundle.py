"""The committed page is the result of its sources."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
STATIC = ROOT / "src/catenary/dashboard/static"


def test_rebuilt_page_equals_the_committed_one(node: str, tmp_path: Path) -> None:
    run = subprocess.run(
        [node, "build.mjs", str(tmp_path / "static")],
        cwd=ROOT / "web",
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr  # fails above the size limit, too
    assert contents(tmp_path / "static") == contents(STATIC), "run: npm run build --prefix web"


def test_page_needs_no_other_server() -> None:
    page = (STATIC / "index.html").read_text()
    assert "http" not in page
    assert "style=" not in page
    assert "<style" not in page


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}
