"""The documented tree of commands is that of the parsers."""

from __future__ import annotations

import re
from pathlib import Path

from catenary import cli
from catenary.cli.main import COMMANDS, make_parser
from tools.command_tree import BLOCK, PAGE, tree


def test_the_page_has_the_present_tree() -> None:
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    assert blocks == [f"{tree(make_parser())}\n"], "run .venv/bin/python tools/command_tree.py"


def test_the_tree_has_every_command_and_subcommand() -> None:
    text = tree(make_parser())
    top = re.findall(r"^[├└]─ (\S+)", text, re.MULTILINE)
    assert top == [module.__name__.rpartition(".")[2] for module in COMMANDS]
    assert re.findall(r"^│  [├└]─ (\S+)  +read", text, re.MULTILINE) == ["read"] * 6


def test_the_pages_name_the_commands_that_reset_the_segment() -> None:
    """`MainDevice.scan` brings the devices to INIT and PRE-OP."""
    sources = Path(cli.__file__).parent.glob("*.py")
    scanning = {each.stem for each in sources if "main.scan(strict=" in each.read_text()}
    parts = {"report_segment": "report"}  # a file that belongs to a command
    names = {parts.get(each, each.replace("_", " ")) for each in scanning}
    assert {"scan", "sdo", "esi make"} <= names
    assert names == named_before(PAGE, "reset the segment and bring it to PRE-OP")
    others = names - {"messages", "shell"}  # not in the table of IgH's commands
    page = PAGE.parents[1] / "how_to" / "from_igh.md"
    assert others == named_before(page, "reset all devices and bring them to PRE-OP")


def named_before(page: Path, words: str) -> set[str]:
    """Return the commands that begin the sentence with these words."""
    [sentence] = re.findall(rf"^(.*) {words}", page.read_text(encoding="utf-8"), re.MULTILINE)
    return set(re.findall(r"`([^`]+)`", sentence))
