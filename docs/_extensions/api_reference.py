"""API reference: the directive `api`, and readable docstrings, signatures and links for autodoc.

    :::{api} catenary.drive
    Move
    Channel
    :::

documents `catenary.drive.Move` and `catenary.drive.Channel` under these short names. Every public
name has to be on exactly one page; the build warns otherwise, and warnings are errors.
"""

from __future__ import annotations

import ast
import inspect
import re
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from public_names import EVENTS, public_names
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.ext.autodoc import Options
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from catenary.types import DataType

LOGGER = logging.getLogger(__name__)
SOURCE = Path(__file__).resolve().parents[2] / "src"
# classes whose members are known: they are not repeated in what derives from them
KNOWN = "object, int, str, tuple, Enum, IntEnum, IntFlag, Struct, Exception, BaseException, Generic"
PAGE = re.compile(r"\bdocs((?:/\w+)+)\.md")
SECTION = re.compile(r"^(Args|Attributes):$", re.MULTILINE)
COMMENT = re.compile(r"^( {4}\w+: [^#\n]*[^#\s])  # (?!noqa|type:|fmt:)", re.MULTILINE)


class Api(SphinxDirective):
    """Document names of a public module.

    Options: `no-inherited` leaves out inherited members, `exclude` the members that it names.
    """

    required_arguments = 1
    has_content = True
    option_spec: ClassVar = {
        "no-inherited": directives.flag,
        "exclude": directives.unchanged_required,
    }

    def run(self) -> list[nodes.Node]:
        module = self.arguments[0]
        lines = ["```{eval-rst}"]
        for name in " ".join(self.content).split():
            lines += ["", *self.entry(module, name)]
        text = "\n".join([*lines, "```"])
        return self.parse_text_to_nodes(text)

    def entry(self, module: str, name: str) -> list[str]:
        """Return the lines of reStructuredText that document a name."""
        found = getattr(import_module(EVENTS if module == "catenary.events" else module), name)
        full = f"{module}.{name}"
        if isinstance(found, DataType):
            return [f".. py:data:: {full}", "", f"   {describe_type(found)}"]
        if not isinstance(found, type):
            return [f".. auto{'function' if callable(found) else 'data'}:: {full}"]
        if found.__name__ != name:
            return self.alias(full, found)
        exception = issubclass(found, BaseException)
        lines = [f".. auto{'exception' if exception else 'class'}:: {full}", "   :members:"]
        if issubclass(found, Enum) or not SECTION.search(inspect.getdoc(found) or ""):
            lines += ["   :undoc-members:"]
        if "exclude" in self.options:
            lines += [f"   :exclude-members: {', '.join(self.options['exclude'].split())}"]
        if exception or module == "catenary.events":
            lines += ["   :show-inheritance:"]
        elif "no-inherited" not in self.options:
            lines += [f"   :inherited-members: {KNOWN}"]
        return lines

    def alias(self, full: str, found: type) -> list[str]:
        """Document a class under the name of the function that users call."""
        lines = (inspect.getdoc(found) or "").splitlines()
        self.env.events.emit("autodoc-process-docstring", "class", full, found, Options(), lines)
        fields = ModuleAnalyzer.for_module(found.__module__).find_attr_docs()
        for (owner, field), comment in fields.items():
            if owner == found.__name__:
                lines += ["", f":param {field}: {' '.join(comment).strip()}"]
        signature = str(inspect.signature(found)).replace("catenary.virtual.faults.", "")
        indented = [f"   {line}" if line else "" for line in lines]
        return [f".. py:function:: {full}{signature}", "", *indented]


def describe_type(data: DataType[Any]) -> str:
    length = f"{data.bit_length} bits" if data.bit_length else "any number of bytes"
    others = f"; also called {', '.join(data.aliases)}" if data.aliases else ""
    return f"Index 0x{data.index:04X}, {length}{others}."


def mark_examples(lines: list[str]) -> list[str]:
    """Return the lines with a directive before each indented block after a paragraph."""
    result: list[str] = []
    in_block = False
    for number, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        before = lines[number - 1] if number else ""
        if not in_block and line.strip() and indent >= 4 and not before.strip():
            previous = next((each for each in reversed(lines[:number]) if each.strip()), "")
            is_item = re.match(r"\s*(-|\d+\.|\w+:)(\s|$)", previous)
            if not is_item and indent - (len(previous) - len(previous.lstrip())) >= 4:
                in_block = True
                result += [" " * (indent - 4) + ".. code-block:: python", ""]
        elif line.strip() and indent < 4:
            in_block = False
        result.append(line)
    return result


def improve_docstring(
    app: Sphinx, what: str, name: str, obj: object, options: Options, lines: list[str]
) -> None:
    """Mark examples as code, link pages, add types of stubs. Runs before napoleon."""
    lines[:] = [PAGE.sub(r":doc:`\1`", line) for line in mark_examples(lines)]
    stub = stub_function(obj) if what in ("attribute", "property") else None
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


def read_stub_signature(
    app: Sphinx, what: str, name: str, obj: Any, options: Options, signature: str, returns: str
) -> tuple[str, str | None] | None:
    """Return the signature that the stub of a compiled function has."""
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


def resolve(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, contnode: nodes.TextElement
) -> nodes.Node | None:
    """Link the types of signatures to their public names; others become text."""
    if node["refdomain"] != "py" or "refwarn" in node:
        return None
    last = node["reftarget"].rsplit(".", 1)[-1]
    domain = env.domains.python_domain
    documented = [
        name
        for name, entry in domain.objects.items()
        if name.rsplit(".", 1)[-1] == last
        and entry.objtype in ("class", "exception")
        and not entry.aliased
    ]
    if len(documented) != 1:
        return contnode
    entry = domain.objects[documented[0]]
    uri = app.builder.get_relative_uri(node["refdoc"], entry.docname)
    return nodes.reference(
        "", "", contnode, internal=True, refuri=f"{uri}#{entry.node_id}", reftitle=documented[0]
    )


def check_public_names(app: Sphinx, env: BuildEnvironment) -> None:
    """Warn of public names that no page documents."""
    documented = {
        name for name, entry in env.domains.python_domain.objects.items() if not entry.aliased
    }
    for name in sorted(public_names() - documented):
        LOGGER.warning("%s is public, but no page documents it: add it to an {api} block", name)


def read_attribute(self: GoogleDocstring) -> list[str]:
    """Return the docstring of an attribute or property as it is: "a: b" is not "type: text"."""
    lines: list[str] = self._consume_to_end()
    return lines


def setup(app: Sphinx) -> dict[str, bool]:
    GoogleDocstring._parse_attribute_docstring = read_attribute  # type: ignore[method-assign]
    ModuleAnalyzer.__init__ = read_comments(ModuleAnalyzer.__init__)  # type: ignore[method-assign]
    app.add_directive("api", Api)
    app.connect("autodoc-process-docstring", improve_docstring, priority=400)
    app.connect("autodoc-process-signature", read_stub_signature)
    app.connect("missing-reference", resolve)
    app.connect("env-check-consistency", check_public_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
