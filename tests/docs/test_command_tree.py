"""The documented tree of commands is that of the parsers."""

from __future__ import annotations

import re

from catenary.cli.main import COMMANDS, make_parser
from tools.command_tree import BLOCK, PAGE, tree


def test_the_page_has_the_present_tree() -> None:
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    assert blocks == [f"{tree(make_parser())}\n"], "run .venv/bin/python tools/command_tree.py"


def test_the_tree_has_every_command_and_subcommand() -> None:
    text = tree(make_parser())
    top = re.findall(r"^[├└]─ (\S+)", text, re.MULTILINE)
    assert top == [module.__name__.rpartition(".")[2] for module in COMMANDS]
    assert re.findall(r"^│  [├└]─ (\S+)  +read", text, re.MULTILINE) == ["read"] * 4
