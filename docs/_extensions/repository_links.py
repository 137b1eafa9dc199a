"""Links from a page to a file of the repository outside of docs.

The pages link by relative paths, which work in a clone. The site has no such files: it shows the
path, or links to `$CATENARY_REPOSITORY/PATH` if this variable is set.
"""

from __future__ import annotations

import os
import re
from pathlib import Path, PurePosixPath

from sphinx.application import Sphinx

LINK = re.compile(r"\[([^\]\n]*)\]\(((?:\.\./)+[^)#\s]+)(#[^)\s]*)?\)")


def rewrite_links(app: Sphinx, docname: str, source: list[str]) -> None:
    """Replace the links that leave docs, in place."""
    folder = PurePosixPath("docs", docname).parent

    def replace(match: re.Match[str]) -> str:
        text, target, _anchor = match.groups()
        path = os.path.normpath(folder / target)
        if PurePosixPath(path).is_relative_to("docs"):
            return match.group()
        if not (Path(app.srcdir).parent / path).exists():
            return match.group()  # Sphinx warns of it
        base = os.environ.get("CATENARY_REPOSITORY")
        if base:
            return f"[{text}]({base.rstrip('/')}/{path})"
        return text if path in text else f"{text} (`{path}`)"

    source[0] = LINK.sub(replace, source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", rewrite_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
