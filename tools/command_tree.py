#!/usr/bin/env python3
"""Write the tree of all commands into docs/reference/command_line.md.

usage: .venv/bin/python tools/command_tree.py

tests/docs/test_command_tree.py checks that the page has the present tree.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

from catenary.cli.main import make_parser

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "command_line.md"
BLOCK = re.compile(
    r"(?<=^## Tree of commands\n\n```\n)(?:catenary\n(?:\W* .*\n)*)?(?=```$)", re.MULTILINE
)


def tree(parser: argparse.ArgumentParser) -> str:
    """Return the commands of a parser as a tree, with one line for each."""
    rows = list(_rows(parser, ""))
    width = max(len(name) for name, _ in rows)
    lines = [f"{name.ljust(width)}  {text}" for name, text in rows]
    return "\n".join([parser.prog, *lines])


def _rows(parser: argparse.ArgumentParser, indent: str) -> Iterator[tuple[str, str]]:
    """Yield the branch and the help of each command, with its subcommands."""
    for group in parser._actions:
        if not isinstance(group, argparse._SubParsersAction):
            continue
        helps = {each.dest: each.help or "" for each in group._choices_actions}
        for number, (name, inner) in enumerate(group.choices.items(), start=1):
            last = number == len(group.choices)
            yield f"{indent}{'└─' if last else '├─'} {name}", helps[name]
            yield from _rows(inner, indent + ("   " if last else "│  "))


def main() -> None:
    text = PAGE.read_text(encoding="utf-8")
    new, count = BLOCK.subn(lambda _: f"{tree(make_parser())}\n", text)
    if count != 1:
        raise SystemExit(f"{PAGE}: the section 'Tree of commands' with one block is missing")
    PAGE.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
