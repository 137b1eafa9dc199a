"""Configuration of Sphinx: `make docs` builds the site into out/docs."""

from __future__ import annotations

import os
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS / "_extensions"))

import catenary  # noqa: E402

project = "Catenary"
author = "the Catenary authors"
copyright = f"{author}. EtherCAT® is a registered trademark and patented technology, licensed by \
Beckhoff Automation GmbH, Germany"
version = release = catenary.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.graphviz",
    "sphinx_copybutton",
    "api_reference",  # these are in _extensions
    "command_line",
    "docstrings",
    "drawings",
    "name_links",
    "repository_links",
    "short_types",
]
exclude_patterns = ["README.md"]
default_role = "code"
highlight_language = "none"
smartquotes = False  # "--" is an option
pygments_style = "a11y-light"
pygments_dark_style = "a11y-dark"
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!catenary\b).*")]  # Python and NumPy, unless online

if os.environ.get("CATENARY_DOCS_ONLINE") == "1":
    extensions.append("sphinx.ext.intersphinx")
    intersphinx_mapping = {
        "python": ("https://docs.python.org/3", None),
        "numpy": ("https://numpy.org/doc/stable", None),
    }

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = True

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
maximum_signature_line_length = 80
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

graphviz_output_format = "svg"
copybutton_exclude = ".linenos, .gp, .go"
copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True

html_theme = "furo"
html_title = f"Catenary {release}"
html_static_path = ["_static"]
html_css_files = ["catenary.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}
