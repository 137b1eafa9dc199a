"""HTML for notebooks."""

from __future__ import annotations

from catenary import notebook


def test_a_table_escapes_its_text() -> None:
    assert notebook.table(["<a>", "b"], [["1", "&"]]) == (
        "<table><thead><tr><th>&lt;a&gt;</th><th>b</th></tr></thead>"
        "<tbody><tr><th>1</th><td>&amp;</td></tr></tbody></table>"
    )


def test_lines_and_columns() -> None:
    assert notebook.lines(["a", "<b>"]) == "<p>a<br>&lt;b&gt;</p>"
    assert notebook.preformatted("a  <b>") == "<pre>a  &lt;b&gt;</pre>"
