"""Links from names in code style: `Loop.timing`, `cat.Drives` and `DriveError` lead to the API."""

from __future__ import annotations

import re
from collections import defaultdict

from docutils import nodes
from sphinx.addnodes import desc_signature
from sphinx.application import Sphinx

NAME = re.compile(r"(?:cat\.|catenary\.)?([A-Z]\w+(?:\.\w+)?|\w+\.[A-Z]\w+)(?:\(.*\))?")
WITHOUT_LINKS = (nodes.reference, nodes.title, nodes.caption, nodes.term, desc_signature)


def targets(app: Sphinx) -> dict[str, str]:
    """Return the full name for each unambiguous short one: the last one or two parts."""
    found = defaultdict(set)
    for name, entry in app.env.domains.python_domain.objects.items():
        if not entry.aliased:
            parts = name.split(".")
            found[parts[-1]].add(name)
            found[".".join(parts[-2:])].add(name)
    return {short: min(names) for short, names in found.items() if len(names) == 1}


def link_names(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Make links of the literals that are names, in place."""
    short = targets(app)
    objects = app.env.domains.python_domain.objects
    for literal in list(doctree.findall(nodes.literal)):
        match = NAME.fullmatch(literal.astext())
        if match is None or match[1] not in short or inside(literal, WITHOUT_LINKS):
            continue
        entry = objects[short[match[1]]]
        uri = app.builder.get_relative_uri(docname, entry.docname)
        link = nodes.reference("", "", internal=True, refuri=f"{uri}#{entry.node_id}")
        link["reftitle"] = short[match[1]]
        literal.replace_self(link)
        link += literal


def inside(node: nodes.Node, kinds: tuple[type[nodes.Node], ...]) -> bool:
    parent = node.parent
    while parent is not None:
        if isinstance(parent, kinds):
            return True
        parent = parent.parent
    return False


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-resolved", link_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
