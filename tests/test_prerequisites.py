"""Missing packages are named in one line."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parent.parent / "tools/missing_prerequisites"


@pytest.fixture
def bare_path(tmp_path):
    """Return a PATH with only the programs that the tool itself runs."""
    for command in ("id", "sh"):
        found = shutil.which(command)
        assert found
        (tmp_path / command).symlink_to(found)
    return tmp_path


def missing(path: str, python: str, *kind: str) -> str:
    done = subprocess.run(
        [str(TOOL), python, *kind], capture_output=True, text=True, check=True, env={"PATH": path}
    )
    assert done.stderr == ""
    return done.stdout


def test_no_output_if_all_packages_are_installed():
    assert missing("/usr/sbin:/usr/bin:/sbin:/bin", sys.executable) == ""


def test_one_line_names_the_packages(bare_path):
    [line] = missing(str(bare_path), sys.executable).splitlines()
    assert line.endswith("apt-get install gcc make iproute2 util-linux")


def test_the_documentation_needs_graphviz(bare_path):
    line = missing(str(bare_path), sys.executable, "docs")
    assert line.endswith("apt-get install gcc make iproute2 util-linux graphviz\n")


def test_a_missing_python_is_three_packages(bare_path):
    line = missing(str(bare_path), "python3")
    assert "apt-get install python3 python3-venv python3-dev gcc" in line


def test_an_old_python_is_named_with_the_solution(bare_path):
    old = bare_path / "python3"
    old.write_text('#!/bin/sh\n[ "$1" = -V ] && echo "Python 3.9.2" && exit\nexit 1\n')
    old.chmod(0o755)
    line = missing(str(bare_path), "python3")
    assert line == (
        "Catenary needs Python 3.11 or newer, and python3 is Python 3.9.2: "
        "make PYTHON=/path/to/python3.11\n"
    )
