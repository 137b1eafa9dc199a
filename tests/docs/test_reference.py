"""Every public name is documented on one page of the reference, by its shortest name."""

from __future__ import annotations

import re
import runpy
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^:::\{api\} (\S+)\n((?::[^\n]*\n)*)(.*?)^:::$", re.MULTILINE | re.DOTALL)


def documented() -> Counter[str]:
    return Counter(
        f"{module}.{name}"
        for page in (ROOT / "docs" / "reference").rglob("*.md")
        for module, _options, names in BLOCK.findall(page.read_text())
        for name in names.split()
    )


def test_every_public_name_is_on_one_page() -> None:
    names = runpy.run_path(str(ROOT / "docs/_extensions/public_names.py"))["public_names"]()
    found = documented()
    assert set(found) == names
    assert [name for name, count in found.items() if count > 1] == []
