"""The table of the cobot: from what the example writes, which is run elsewhere (tests/scenario)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.tables import cobot
from benchmarks.tables.published import COBOT
from benchmarks.tables.sheet import Options, as_json, show
from catenary.errors import CatenaryError

FOUND = {
    "rms_deg": 0.03,
    "rms_deg_without": 1.4,
    "tasks": [
        {"name": name, "period": [1, 1, 1, 0], "jitter": [2] * 4, "response": [3] * 4}
        for name in COBOT
    ],
    "utilisation": 0.5,
    "schedulable": True,
    "times_real_time": 5.5,
    "bounds_us": {name: 3.5 for name in COBOT},
    "beyond": [],
}
WRITES = """
import sys
from pathlib import Path
folder = Path(sys.argv[sys.argv.index("--out") + 1])
(folder / "cobot.json").write_text({text!r})
"""


def example(folder: Path, text: str) -> Path:
    file = folder / "cobot.py"
    file.write_text(text)
    return file


@pytest.fixture(autouse=True)
def _all_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cobot, "find_spec", lambda _name: object())


def test_ours_stands_beside_theirs(tmp_path: Path) -> None:
    path = example(tmp_path, WRITES.format(text=json.dumps(FOUND)))
    sheet = cobot.measure(Options(example=path))
    lines = sheet.text.splitlines()
    assert [line.split()[0] for line in lines[1:3]] == ["dynamics", "published"]
    assert "theirs: utilisation 73.7%" in sheet.text
    assert "ours: utilisation 50.0%, schedulable" in sheet.text
    assert json.loads(as_json("cobot", sheet))["ours"]["rms_deg"] == 0.03


def test_without_the_example_the_published_table_remains(tmp_path: Path) -> None:
    text = show(cobot.measure(Options(example=tmp_path / "none.py")))
    assert "main control (theirs)" in text
    assert "225.2/339.4/133.5/19.4" in text
    assert "none.py does not exist (give its path with --example)" in text


def test_what_it_needs_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cobot, "find_spec", lambda name: None if name == "ruckig" else object())
    assert "ruckig not installed" in cobot.why_not(Options())


def test_a_program_that_fails_is_quoted(tmp_path: Path) -> None:
    path = example(tmp_path, "raise SystemExit('the arm is gone')")
    with pytest.raises(CatenaryError, match="the arm is gone"):
        cobot.measure(Options(example=path))


def test_the_example_is_found_in_the_repository() -> None:
    assert cobot.program(Options()).exists()
