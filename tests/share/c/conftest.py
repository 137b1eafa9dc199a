"""The shared library and the program, each compiled once."""

from pathlib import Path

import pytest

from tests.share.c.compile import C11, CPP17, INCLUDE, build, build_program
from tests.share.c.library import Library


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    output = tmp_path_factory.mktemp("library") / "libcatenary_share.so"
    source = INCLUDE / "catenary_share.c"
    return Library(build(output, C11, "-O2", "-shared", "-fPIC", source))


@pytest.fixture(scope="session", params=[C11, CPP17], ids=["C11", "C++17"])
def program(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_program(tmp_path_factory.mktemp("program"), request.param)
