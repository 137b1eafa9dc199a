"""Drawings as SVG inside the page, in the colours of the theme: light and dark.

    ```{graphviz} ../diagrams/layers.dot
    :alt: The layers of the package
    ```

    ```{drawing} one_cycle
    :alt: One cycle, drawn to scale
    :caption: …
    ```

`drawing` runs `docs/figures/one_cycle.py`, whose `draw()` returns a figure of Matplotlib. Black
becomes the text colour of the theme; the four names in `COLOURS` may be used for the rest.
"""

from __future__ import annotations

import io
import re
import runpy
from html import escape
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.ext.graphviz import graphviz, render_dot
from sphinx.util.docutils import SphinxDirective
from sphinx.writers.html5 import HTML5Translator

# In a drawing: a colour that no theme has. In the page: a variable of catenary.css.
COLOURS = {
    "#000000": "currentColor",
    "#0000aa": "var(--drawing-blue)",
    "#00aa00": "var(--drawing-green)",
    "#aa0000": "var(--drawing-red)",
    "#aaaaaa": "var(--drawing-grey)",
    "#eeeeee": "var(--drawing-fill)",
    "#ffffff": "var(--color-background-primary)",
}
NAMED = {"black": "#000000", "white": "#ffffff"}


class drawing(nodes.General, nodes.Inline, nodes.Element):  # noqa: N801  a docutils node
    """A drawing as the text of an SVG file."""


class Drawing(SphinxDirective):
    """A figure of Matplotlib."""

    required_arguments = 1
    option_spec: ClassVar = {"alt": directives.unchanged_required, "caption": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        name = self.arguments[0]
        path = Path(self.env.srcdir) / "figures" / f"{name}.py"
        self.env.note_dependency(str(path))
        node = drawing(svg=make_svg(path), alt=self.options["alt"], prefix=name)
        if "caption" not in self.options:
            return [node]
        text, messages = self.parse_inline(self.options["caption"])
        return [nodes.figure("", node, nodes.caption("", "", *text)), *messages]


def make_svg(path: Path) -> str:
    """Return the figure of a script as SVG whose text stays text."""
    import matplotlib

    matplotlib.use("Agg")
    options = {
        "svg.fonttype": "none",
        "svg.hashsalt": path.stem,
        "font.family": "sans-serif",
        "font.size": 10,
    }
    with matplotlib.rc_context(options):
        figure = runpy.run_path(str(path))["draw"]()
        file = io.StringIO()
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None})
    return file.getvalue()


def in_page(svg: str, *, alt: str, prefix: str) -> str:
    """Return the HTML of a drawing: without a header, in the theme's colours, with its own ids."""
    svg = svg[svg.index("<svg") :]
    for name, number in NAMED.items():
        svg = re.sub(rf'(fill|stroke)="{name}"', rf'\1="{number}"', svg)
    for number, variable in COLOURS.items():
        svg = svg.replace(f'"{number}"', f'"{variable}"').replace(f": {number}", f": {variable}")
    svg = re.sub(r"font-family=\"[^\"]*\"", 'font-family="inherit"', svg)
    svg = re.sub(r"(font: [\d.]+px) [^\";]*", r"\1 inherit", svg)
    svg = re.sub(r"\bid=\"", f'id="{prefix}-', svg)
    svg = re.sub(r"(href=\"#|url\(#)", rf"\1{prefix}-", svg)
    width = re.search(r'width="([\d.]+)pt"', svg)
    least = f"min-width:min({float(width[1]):.0f}pt, 30rem)" if width else ""
    svg = svg.replace("<svg", f'<svg style="{least}"', 1)
    return f'<div class="drawing" role="img" aria-label="{escape(alt)}">{svg}</div>'


def visit_drawing(self: HTML5Translator, node: drawing) -> None:
    self.body.append(in_page(node["svg"], alt=node["alt"], prefix=node["prefix"]))
    raise nodes.SkipNode


def visit_graphviz(self: HTML5Translator, node: graphviz) -> None:
    _, path = render_dot(self, node["code"], node["options"], "svg", "graphviz")
    if path is None:
        raise nodes.SkipNode  # `dot` failed, and Sphinx has warned
    prefix = Path(path).stem[-8:]
    alt = node.get("alt", "diagram")
    self.body.append(in_page(Path(path).read_text(), alt=alt, prefix=f"g{prefix}"))
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("drawing", Drawing)
    app.add_node(drawing, html=(visit_drawing, None))
    app.add_node(graphviz, override=True, html=(visit_graphviz, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
