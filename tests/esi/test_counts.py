"""Counts of features (tools/esi_counts.py), and that the corpus has every feature."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.esi import corpus

TOOL = Path(__file__).resolve().parents[2] / "tools" / "esi_counts.py"


def run(*arguments: Path) -> tuple[int, dict[str, int], str]:
    done = subprocess.run(
        [sys.executable, TOOL, *arguments], capture_output=True, text=True, check=False
    )
    lines = [line.rsplit(maxsplit=1) for line in done.stdout.splitlines() if line[-1:].isdigit()]
    rows = {line[0]: int(line[1]) for line in lines if not line[0].startswith("refused")}
    return done.returncode, rows, done.stdout


def test_the_corpus_has_every_feature(tmp_path: Path) -> None:
    for number, data in enumerate(corpus.FILES.values()):
        (tmp_path / f"{number:03d}.xml").write_bytes(data)
    code, rows, text = run(tmp_path)
    assert (code, rows["files"]) == (0, len(corpus.FILES))
    assert [name for name, number in rows.items() if number == 0] == []
    assert "refused" not in text


def test_refused_files_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_bytes(corpus.FAULTY_FILES["truncated"])
    code, rows, text = run(path)
    assert (code, rows["files"]) == (1, 0)
    assert f"refused: {path}:" in text
