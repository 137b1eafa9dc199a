"""The table of IgH's commands is complete, and the commands of Catenary in it exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from catenary.cli.main import make_parser

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "how_to" / "from_igh.md"
# `ethercat` 1.6.1, tool/*.cpp
COMMANDS = (
    *("alias", "config", "crc", "cstruct", "data", "debug", "domains", "download", "eoe"),
    *("foe_read", "foe_write", "graph", "ip", "master", "pdos", "reg_read", "reg_write"),
    *("rescan", "sdos", "sii_read", "sii_write", "slaves", "soe_read", "soe_write", "states"),
    *("upload", "version", "xml"),
)
PLANNED = re.compile(r"(EoE) is not available yet")


def rows() -> dict[str, tuple[str, str]]:
    """Return the columns `catenary` and differences by IgH's command."""
    section = PAGE.read_text().partition("## The `ethercat` command")[2].partition("\n## ")[0]
    table = section.partition("| differences |")[2].partition("\n\n")[0]
    cells = [line.strip("|").split(" | ") for line in table.splitlines()[2:]]
    return {re.findall(r"`(\w+)", theirs)[0]: (ours, note) for theirs, ours, note in cells}


def ours() -> list[str]:
    return [call for cell, _ in rows().values() for call in re.findall(r"`([^`]+)`", cell)]


def test_the_table_has_every_command() -> None:
    assert tuple(rows()) == COMMANDS
    assert len(COMMANDS) == 28


@pytest.mark.parametrize("call", ours())
def test_the_commands_exist(call: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    if call.startswith("--"):
        assert call in make_parser().format_help()
    else:
        make_parser().parse_args(shlex.split(call))


@pytest.mark.parametrize("name", COMMANDS)
def test_a_row_without_a_command_is_planned(name: str) -> None:
    cell, note = rows()[name]
    assert ("`" in cell) or (cell.strip() == "planned" and PLANNED.search(note)), cell
