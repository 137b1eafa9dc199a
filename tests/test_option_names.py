"""All options that a message or a document names exist, such as `Loop(period=...)`."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

import catenary as cat

ROOT = Path(__file__).parent.parent
PAGES = sorted([*ROOT.glob("src/**/*.py"), *ROOT.glob("docs/**/*.md"), ROOT / "README.md"])


@pytest.mark.parametrize(
    "owner",
    [cat.Loop, cat.Drives, cat.StopPolicy, cat.Scheduling, cat.ClockOptions],
    ids=lambda owner: owner.__name__,
)
def test_every_option_exists(owner: type) -> None:
    known = set(inspect.signature(owner).parameters)
    first_option = re.compile(rf"\b{owner.__name__}\((\w+)=")
    wrong = {
        f"{page.relative_to(ROOT)}: {name}"
        for page in PAGES
        for name in first_option.findall(page.read_text())
        if name not in known
    }
    assert not wrong
