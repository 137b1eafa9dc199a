"""The README refers to existing files, and shows the tested example."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()


def test_the_example_is_the_one_in_the_repository() -> None:
    [block] = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert block == (ROOT / "examples" / "three_drives.py").read_text()


@pytest.mark.parametrize("link", sorted(set(re.findall(r"\]\(([^)#]+)\)", README))))
def test_the_links_of_the_readme_exist(link: str) -> None:
    assert link.startswith("https://") or (ROOT / link).exists()


def test_the_readme_names_the_trademark() -> None:
    assert (
        "EtherCAT® is a registered trademark and patented technology, licensed by Beckhoff "
        "Automation GmbH, Germany" in " ".join(README.split())
    )
