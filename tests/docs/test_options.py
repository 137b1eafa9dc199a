"""The tables of docs/reference/options.md list every option, and no other."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

import catenary as cat

TEXT = (Path(__file__).resolve().parents[2] / "docs/reference/options.md").read_text()
HEADED = [cat.Loop, cat.Drives, cat.ProcessData, cat.DistributedClock, cat.StartUp, cat.MainDevice]
GROUPS = [cat.StopPolicy, cat.Scheduling, cat.ClockOptions, cat.ExternalClock]
POSITIONAL = {"requests", "subs", "sub"}


def section(owner: type) -> str:
    return TEXT.split(f"\n## `{owner.__name__}`\n")[1].split("\n## ")[0].split("\nNames for")[0]


def group(owner: type) -> str:
    return TEXT.split(f"\n| `{owner.__name__}` |")[1].split("\n\n")[0]


def options_in(table: str) -> set[str]:
    first_cells = re.findall(r"^\| (`[^|]*) \|", table, re.MULTILINE)
    return {name for cell in first_cells for name in re.findall(r"`(\w+)`", cell)}


@pytest.mark.parametrize("owner", [*HEADED, *GROUPS], ids=lambda owner: owner.__name__)
def test_every_option_is_listed(owner: type) -> None:
    table = group(owner) if owner in GROUPS else section(owner)
    known = {name for name in inspect.signature(owner).parameters if not name.startswith("_")}
    assert options_in(table) == known - POSITIONAL
