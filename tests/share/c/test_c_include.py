"""The header: its folder, its files in the wheel, and its use without a separate source file."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.share.c.compile import C11, CPP17, INCLUDE, SANITIZERS, build, has_sanitizers

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = """
#define _GNU_SOURCE
#define CATENARY_SHARE_IMPLEMENTATION
#include "catenary_share.h"
int main(void) {
    catenary_error error;
    catenary_share *share;
    int code = catenary_open(&share, "no such name", CATENARY_OWN_UID, 0, &error);
    return code == CATENARY_E_ARGUMENT && error.code == code && !share ? 0 : 1;
}
"""


def test_command_prints_the_folder_of_the_header() -> None:
    command = [sys.executable, "-m", "catenary.cli", "include"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert (Path(printed) / "catenary_share.h").is_file()
    assert (Path(printed) / "catenary_share.c").is_file()


@pytest.mark.parametrize("language", [C11, CPP17], ids=["C11", "C++17"])
def test_header_can_contain_the_implementation(tmp_path: Path, language: tuple[str, ...]) -> None:
    source = tmp_path / "program.c"
    source.write_text(PROGRAM if language == C11 else PROGRAM.replace("#define _GNU_SOURCE", ""))
    options = SANITIZERS if has_sanitizers(tmp_path) else ()
    program = build(tmp_path / "program", language, *options, source)
    assert subprocess.run([program]).returncode == 0


def test_wheel_contains_all_files_that_the_header_includes() -> None:
    pathspec = pytest.importorskip(
        "pathspec", reason="pathspec reads the patterns as the build does"
    )
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]
    excluded = pathspec.GitIgnoreSpec.from_lines(settings["wheel"]["exclude"])
    source = ROOT / "src" / "catenary"
    command = ["cc", "-MM", "-MT", "", str(INCLUDE / "catenary_share.c")]
    rule = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    needed = [Path(word).resolve() for word in rule.replace("\\\n", " ").split() if word != ":"]
    assert len(needed) > 10
    for path in needed:
        relative = path.relative_to(INCLUDE.parent)
        assert (source / relative).is_file()
        assert not excluded.match_file(relative)
        assert not excluded.match_file(Path("catenary") / relative)
    assert excluded.match_file("core/_cycle.pyx")
    assert excluded.match_file("native/law.h")
