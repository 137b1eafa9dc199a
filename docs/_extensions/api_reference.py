"""API reference: the directive `api`, and links from types to their public names.

    :::{api} catenary.drive
    Move
    Channel
    :::

documents `catenary.drive.Move` and `catenary.drive.Channel` under these short names. Every public
name has to be on exactly one page; the build warns otherwise, and warnings are errors.
"""

from __future__ import annotations

import inspect
import re
import sys
import types
from enum import Enum
from importlib import import_module
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from public_names import EVENTS, public_names
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.ext.autodoc import Options
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from catenary.types import DataType

LOGGER = logging.getLogger(__name__)
# the members of these classes are not repeated in classes that derive from them
KNOWN = (
    "object, int, str, tuple, Enum, IntEnum, Struct, BaseException, Generic, Sequence, Mapping, "
    "Device, DataType"
)
SECTION = re.compile(r"^(Args|Attributes):$", re.MULTILINE)


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
        home = import_module(EVENTS if module == "catenary.events" else module)
        found = getattr(home, name, None)
        if found is None:
            raise self.error(f"{module} has no name {name!r}")
        full = f"{module}.{name}"
        self.note_files(found)
        if isinstance(found, DataType):
            return [f".. py:data:: {full}", "", f"   {describe_type(found)}"]
        if isinstance(found, types.UnionType):
            names = ", ".join(f"`{each.__name__}`" for each in found.__args__)
            return [f".. py:data:: {full}", "", f"   Any of {names}."]
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
            lines += ["   :show-inheritance:"] * (found.__base__ is not object)
        elif "no-inherited" not in self.options:
            lines += [f"   :inherited-members: {KNOWN}"]
        return lines

    def note_files(self, found: object) -> None:
        """Build the page again after a change of this file, or of the module of a name."""
        for name in (__name__, getattr(found, "__module__", None)):
            path = getattr(sys.modules.get(name or ""), "__file__", None)
            if path is not None:
                self.env.note_dependency(path)

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


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("api", Api)
    app.connect("missing-reference", resolve)
    app.connect("env-check-consistency", check_public_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
