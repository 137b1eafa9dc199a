"""Content of the guest's root."""

from __future__ import annotations

import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest

from tools.rtlab import root
from tools.rtlab.errors import LabError

REQUIRES = [
    "numpy>=1.26",
    'numba>=0.61; extra == "law"',
    "mcap[zstd, lz4]; extra == 'log'",
    'tomli; python_version < "3.11"',
    "foo.bar",
]
# printed by ldd of Debian 12
LDD = """/usr/bin/ip:
\tlinux-vdso.so.1 (0x00007ffd3d5f2000)
\tlibmnl.so.0 => /lib/x86_64-linux-gnu/libmnl.so.0 (0x00007f2a)
\tlibgone.so => not found
\t/lib64/ld-linux-x86-64.so.2 (0x00007f2a8a4c7000)
/x/static:
\tstatically linked
"""


def test_the_dependencies_of_a_distribution_include_extras() -> None:
    plain = {"numpy", "foo.bar"}
    assert {name for name, _ in root.needed_by(REQUIRES, frozenset())} == plain
    found = dict(root.needed_by(REQUIRES, frozenset({"law", "log"})))
    assert set(found) == {*plain, "numba", "mcap"}
    assert found["mcap"] == {"zstd", "lz4"}


def test_all_imports_of_a_benchmark_are_included() -> None:
    found = {each.metadata["Name"].lower() for each in root.distributions("catenary", ["law"])}
    assert {"catenary", "numpy", "msgspec", "numba", "llvmlite"} <= found


def test_a_missing_distribution_is_an_error_of_one_line() -> None:
    with pytest.raises(LabError, match=r"no-such-thing is not installed.*make build"):
        root.distributions("no-such-thing")


def test_the_tests_of_a_distribution_are_omitted() -> None:
    files = list(root.files_of(distribution("numpy")))
    assert any(path.name == "__init__.py" for path in files)
    assert not any("tests" in path.parts for path in files)


def test_libraries_and_the_loader_are_read_from_ldd() -> None:
    assert root.loaded(LDD) == [
        Path("/lib/x86_64-linux-gnu/libmnl.so.0"),
        Path("/lib64/ld-linux-x86-64.so.2"),
    ]


def test_the_libraries_of_the_interpreter_are_included() -> None:
    names = {path.name for path in root.libraries([Path(sys.executable)])}
    assert "libc.so.6" in names


def test_the_standard_library_is_included_without_its_tests() -> None:
    files = list(root.interpreter())
    assert Path(sys.executable) in files
    assert any(path.name == "argparse.py" for path in files)
    assert not any("site-packages" in path.parts or "test" in path.parts for path in files)


def test_a_missing_program_names_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(LabError, match="iproute2"):
        list(root.programs())
