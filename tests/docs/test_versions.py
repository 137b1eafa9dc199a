"""The page of versions names existing names and the present formats."""

from __future__ import annotations

import re
import tomllib

from catenary.cli.report_archive import FORMAT as REPORT
from catenary.line.fields import FORMAT as CLONE
from catenary.machine.schema import FORMAT as MACHINE
from catenary.record.channels import FORMAT as RECORDING
from catenary.remote.messages import VERSION as MESSAGES
from catenary.share.layout import VERSION as SHARE
from docs._extensions.public_names import public_names
from tests.docs.page import ROOT

PAGE = (ROOT / "docs" / "reference" / "versions.md").read_text()
EXPERIMENTAL = re.findall(r"^\| `(catenary\.[\w.]+)` \|", PAGE, re.MULTILINE)


def test_the_page_has_the_present_formats() -> None:
    for words in (
        f"format `{MACHINE}`",
        f"share, layout version {SHARE},",
        f"message version {MESSAGES} ",
        f"recordings, format {RECORDING} ",
        f"clone, format {CLONE} ",
        f"`catenary report`, format {REPORT} ",
    ):
        assert words in PAGE


def test_the_page_names_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert f"This is version {project['version']}" in PAGE


def test_experimental_names_exist() -> None:
    public = public_names()
    assert len(EXPERIMENTAL) > 5
    for name in EXPERIMENTAL:
        assert any(each == name or each.startswith(f"{name}.") for each in public), name
