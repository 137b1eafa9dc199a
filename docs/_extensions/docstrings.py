"""Docstrings as the package writes them, made into reStructuredText.

- An indented block after a paragraph is an example, or a list of `name: text`.
- `docs/how_to/moves.md` is a link.
- A comment at the end of a field is the field's documentation.
- The types of compiled properties and the signatures of compiled functions come from the stubs.
"""

from __future__ import annotations

import ast
import re
import textwrap
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from public_names import RETURNED
from sphinx.application import Sphinx
from sphinx.ext.autodoc import Options
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer

SOURCE = Path(__file__).resolve().parents[2] / "src"
PAGE = re.compile(r"\bdocs((?:/\w+)+)\.md")
ITEM = re.compile(r"\s*(-|\d+\.|\w+:)(\s|$)")
NAMED = re.compile(r"\w+(, \w+)*: ")
COMMENT = re.compile(
    r"^( {4}\w+: [^#\n]*[^#\s]| {8}self\.[a-z]\w*(?:: [^=#\n]+)? = [^#\n]*[^#\s])"
    r"  # (?!noqa|type:|fmt:)",
    re.MULTILINE,
)


def indent_of(line: str) -> int:
    return len(line) - len(line.lstrip())


def mark_blocks(lines: list[str]) -> list[str]:
    """Return the lines with each indented block after a paragraph as code or as a list."""
    result: list[str] = []
    previous = ""  # last line with text outside of blocks
    number = 0
    while number < len(lines):
        line = lines[number]
        begins = line.strip() and not (result[-1].strip() if result else "text")
        if begins and indent_of(line) >= indent_of(previous) + 4 and not ITEM.match(previous):
            end = number
            while end < len(lines) and (
                not lines[end].strip() or indent_of(lines[end]) >= indent_of(line)
            ):
                end += 1
            result += format_block(lines[number:end], indent_of(previous))
            number = end
            continue
        previous = line if line.strip() else previous
        result.append(line)
        number += 1
    return result


def format_block(block: list[str], indent: int) -> list[str]:
    """Return a block as a list of names, as Python, or as plain text."""
    text = textwrap.dedent("\n".join(block)).rstrip()
    starts = [line for line in text.splitlines() if line and not line.startswith(" ")]
    if len(starts) > 1 and all(NAMED.match(line) for line in starts):
        items = [
            "- **{}**: {}".format(*line.split(": ", 1)) if line in starts else f"  {line}"
            for line in text.splitlines()
        ]
        return [" " * indent + line for line in items] + [""]
    try:
        ast.parse(text)
        language = "python"
    except SyntaxError:
        language = "text"
    code = [f".. code-block:: {language}", "", *textwrap.indent(text, "   ").splitlines(), ""]
    return [" " * indent + line for line in code]


def improve_docstring(
    app: Sphinx, what: str, name: str, obj: object, options: Options, lines: list[str]
) -> None:
    """Change a docstring in place. Runs before napoleon."""
    lines[:] = [PAGE.sub(r":doc:`\1`", line) for line in mark_blocks(lines)]
    if what not in ("attribute", "property"):
        return
    if lines and lines[0][:1].islower():  # a comment
        lines[0] = lines[0][0].upper() + lines[0][1:]
        last = max(number for number, line in enumerate(lines) if line.strip())
        lines[last] += "" if lines[last].endswith((".", ":")) else "."
    stub = stub_function(obj)
    if stub is not None and stub.returns is not None:
        lines += ["", f":type: {ast.unparse(stub.returns)}"]


@cache
def stub_of(module: str) -> dict[str, ast.FunctionDef]:
    """Return the functions of a compiled module's stub, by qualified name."""
    path = SOURCE / f"{module.replace('.', '/')}.pyi"
    if not path.exists():
        return {}
    found = {}
    for node in ast.parse(path.read_text()).body:
        inner = node.body if isinstance(node, ast.ClassDef) else [node]
        prefix = f"{node.name}." if isinstance(node, ast.ClassDef) else ""
        found |= {prefix + each.name: each for each in inner if isinstance(each, ast.FunctionDef)}
    return found


def stub_function(obj: Any) -> ast.FunctionDef | None:
    """Return the stub of a compiled function or property; None if it is not compiled."""
    owner = getattr(obj, "__objclass__", obj)
    stub = stub_of(getattr(owner, "__module__", None) or "")
    return stub.get(getattr(obj, "__qualname__", ""))


def choose_signature(
    app: Sphinx, what: str, name: str, obj: Any, options: Options, signature: str, returns: str
) -> tuple[str, str | None] | None:
    """Return the signature of a compiled function; none for classes that users do not call."""
    module, _, last = name.rpartition(".")
    if what == "class" and (module == "catenary.events" or last in RETURNED.get(module, ())):
        return "", None
    function = stub_function(obj) if what in ("function", "method") else None
    if function is None:
        return None
    arguments = ast.unparse(function.args).removeprefix("self").removeprefix(", ")
    return f"({arguments})", ast.unparse(function.returns) if function.returns else None


def read_comments(init: Any) -> Any:
    """Return a constructor of ModuleAnalyzer for which comments of fields are documentation."""

    def wrapper(self: ModuleAnalyzer, source: str, modname: str, srcname: str) -> None:
        if modname.startswith("catenary"):
            source = COMMENT.sub(r"\1  #: ", source)
        init(self, source, modname, srcname)

    return wrapper


def read_attribute(self: GoogleDocstring) -> list[str]:
    """Return the docstring of an attribute or property as it is: "a: b" is not "type: text"."""
    lines: list[str] = self._consume_to_end()
    return lines


def replace_dashes(app: Sphinx, doctree: nodes.document) -> None:
    """Write a dash between a parameter and its text; Sphinx leaves it to its smart quotes."""
    for text in list(doctree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" – "))


def setup(app: Sphinx) -> dict[str, bool]:
    GoogleDocstring._parse_attribute_docstring = read_attribute  # type: ignore[method-assign]
    ModuleAnalyzer.__init__ = read_comments(ModuleAnalyzer.__init__)  # type: ignore[method-assign]
    app.connect("autodoc-process-docstring", improve_docstring, priority=400)
    app.connect("autodoc-process-signature", choose_signature)
    app.connect("doctree-read", replace_dashes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
