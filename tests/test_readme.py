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


LINK = re.compile(r"\]\(([^)#]+)(?:#[\w-]+)?\)|src=\"([^\"]+)\"")
LINKS = sorted({link or image for link, image in LINK.findall(README)})
FIRST_SCREEN = 35  # lines


def test_the_first_screen_has_all_that_a_newcomer_needs() -> None:
    screen = "\n".join(README.splitlines()[:FIRST_SCREEN])
    for needed in ("EtherCAT for Python", "never a real device", "<img ", "make demo", "```python"):
        assert needed in screen
    assert screen.count("```") == 2  # the whole program


@pytest.mark.parametrize("link", LINKS)
def test_the_links_of_the_readme_exist(link: str) -> None:
    assert link.startswith("https://") or (ROOT / link).exists()


def test_the_readme_names_the_trademark() -> None:
    assert (
        "EtherCAT® is a registered trademark and patented technology, licensed by Beckhoff "
        "Automation GmbH, Germany" in " ".join(README.split())
    )
