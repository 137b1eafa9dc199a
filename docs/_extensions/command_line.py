"""The directive `command-line`: a section for each command, from the parsers of `catenary`."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

MARKED = re.compile(r"(`[^`]+`|\bdocs/[\w/]+\.md\b)")
Parsers = Iterator[tuple[argparse.ArgumentParser, str]]


def subparsers(parser: argparse.ArgumentParser) -> Parsers:
    """Yield the parser of each command with its line in the list of commands."""
    for group in parser._actions:
        if isinstance(group, argparse._SubParsersAction):
            helps = {each.dest: each.help or "" for each in group._choices_actions}
            for name, inner in group.choices.items():
                yield inner, helps.get(name, "")


class CommandLine(SphinxDirective):
    """Sections of all commands, with their arguments and examples."""

    def run(self) -> list[nodes.Node]:
        os.environ["COLUMNS"] = "10000"  # one line for each paragraph
        from catenary.cli import main, parsers

        self.env.note_dependency(parsers.__file__)
        for path in Path(main.__file__).parent.glob("*.py"):
            self.env.note_dependency(str(path))
        return [self.section(parser, line) for parser, line in subparsers(main.make_parser())]

    def section(self, parser: argparse.ArgumentParser, line: str) -> nodes.section:
        """Return the section of a command, with those of its subcommands."""
        section = nodes.section(ids=[nodes.make_id(parser.prog)], names=[parser.prog])
        section += nodes.title("", "", nodes.literal("", parser.prog))
        for paragraph in (parser.description or line).splitlines():
            section += self.paragraph(paragraph)
        inner = list(subparsers(parser))
        if not inner:
            section += self.usage(parser)
            section += self.arguments_of(parser)
            section += self.example(parser)
        section += [self.section(each, line) for each, line in inner]
        self.state.document.note_explicit_target(section)
        return section

    def usage(self, parser: argparse.ArgumentParser) -> nodes.literal_block:
        usage = parser.format_usage().removeprefix("usage: ").strip().replace(" [-h]", "")
        lines = [parser.prog]
        for part in re.findall(r"\[[^\[\]]*(?:\[[^\]]*\][^\[\]]*)*\]|\(.*\)|\S+", usage)[
            len(parser.prog.split()) :
        ]:
            if len(lines[-1]) + len(part) > 76:
                lines.append("   ")
            lines[-1] += f" {part}"
        text = "\n".join(lines)
        return nodes.literal_block(text, text, language="none")

    def arguments_of(self, parser: argparse.ArgumentParser) -> list[nodes.Node]:
        items = []
        for action in parser._actions:
            if action.help is argparse.SUPPRESS or isinstance(action, argparse._HelpAction):
                continue
            names = ", ".join(action.option_strings)
            values = action.metavar or ("|".join(map(str, action.choices or ())) or action.dest)
            if isinstance(values, tuple):
                values = " ".join(values)
            takes = action.nargs != 0
            shown = " ".join(filter(None, (names, values if takes else "")))
            item = nodes.definition_list_item()
            item += nodes.term("", "", nodes.literal("", shown))
            text = (action.help or "") % dict(vars(action), prog=parser.prog)
            item += nodes.definition("", self.paragraph(text))
            items.append(item)
        return [nodes.definition_list("", *items)] if items else []

    def example(self, parser: argparse.ArgumentParser) -> list[nodes.Node]:
        _, found, text = (parser.epilog or "").partition("example:\n")
        if not found:
            return []
        lines = "\n".join(line.removeprefix("  ") for line in text.splitlines())
        block = nodes.literal_block(lines, lines, language="bash")
        return [nodes.paragraph("", "Example:"), block]

    def paragraph(self, text: str) -> nodes.paragraph:
        """Return a paragraph in which names of pages are links."""
        result = nodes.paragraph()
        for part in MARKED.split(text):
            if part.startswith("`"):
                result += nodes.literal("", part.strip("`"))
            elif part.startswith("docs/"):
                page = part.removeprefix("docs").removesuffix(".md")
                options = {"refdomain": "std", "reftype": "doc", "reftarget": page}
                result += pending_xref(
                    "",
                    nodes.inline("", page),
                    refdoc=self.env.docname,
                    refexplicit=False,
                    refwarn=True,
                    **options,
                )
            else:
                result += nodes.Text(part)
        return result


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
