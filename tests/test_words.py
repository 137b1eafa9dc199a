"""The linter of prose: `tools/words.py`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

WORDS = Path(__file__).resolve().parent.parent / "tools" / "words.py"


def check(path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, WORDS, path], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.py", "# a device who is gone\n"),
        ("a.py", 'def f() -> None:\n    """What the drive does."""\n'),
        ("a.pyx", "cdef int x  # the queue runs dry\n"),
        ("a.h", "/* the thread is told\n   to stop */\n"),
        ("a.md", "A share is no file.\n"),
    ],
)
def test_a_line_in_the_old_words_is_reported(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    done = check(path)
    assert done.returncode == 1
    assert done.stdout.startswith(f"{path}:")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.py", "# Return the devices that do not answer.\n"),
        ("a.py", "who = 1\n"),
        ("a.py", "keys = ('who',)  # words: ok\n"),
        ("a.py", 'text = f"{who}: no answer"\n'),
        ("a.h", "int who; /* position of the device */\n"),
        ("a.md", "There is no device.\n\n```python\nwho = nobody\n```\n\nUse `who`.\n"),
    ],
)
def test_code_and_plain_sentences_pass(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    done = check(path)
    assert done.returncode == 0, done.stdout


def test_no_conflict_is_committed() -> None:
    root = WORDS.parent.parent
    marks = ("<" * 7 + " ", ">" * 7 + " ")
    for path in [*root.glob("docs/**/*.md"), *root.glob("src/**/*.p*[yxd]"), *root.glob("*.md")]:
        assert not any(line.startswith(marks) for line in path.read_text().splitlines()), path
