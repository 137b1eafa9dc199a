"""What tests stand on: shared data, wires of our own, tshark, a machine of the laboratory.

A test that uses `shared_data`, `veth`, `tshark` or `rtlab` is skipped, with the reason, where there
is none, and is marked `shared_data`, `wire`, `tshark` or `rtlab`. `--require MARKER` turns those
skips into failures, and fails when no test so marked passed: what CI asks for.
"""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Never

import hypothesis
import pytest

from catenary.realtime import private_network

ROOT = Path(__file__).resolve().parent.parent
# marker: fixture
FIXTURE_OF = {"shared_data": "shared_data", "wire": "veth", "tshark": "tshark", "rtlab": "rtlab"}

# no deadlines: nothing timed is asserted; the same examples each time where CI says so
hypothesis.settings.register_profile(
    "catenary", max_examples=50, deadline=None, derandomize=bool(os.environ.get("CI"))
)
hypothesis.settings.load_profile("catenary")

REQUIRED = pytest.StashKey[set[str]]()
PASSED = pytest.StashKey[set[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--require",
        action="append",
        default=[],
        choices=sorted(FIXTURE_OF),
        metavar="MARKER",
        help="fail unless tests with this marker ran (shared_data, wire, tshark, rtlab)",
    )


def pytest_configure(config: pytest.Config) -> None:
    # A shell ignores SIGINT for what it starts in the background, and that is inherited.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    config.stash[REQUIRED] = set(config.getoption("--require"))
    config.stash[PASSED] = set()


def pytest_itemcollected(item: pytest.Item) -> None:
    for marker, fixture in FIXTURE_OF.items():
        if fixture in getattr(item, "fixturenames", ()):
            item.add_marker(marker)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.when == "call" and report.passed:
        item.config.stash[PASSED].update(mark.name for mark in item.iter_markers())
    return report


def pytest_sessionfinish(session: pytest.Session) -> None:
    missing = session.config.stash[REQUIRED] - session.config.stash[PASSED]
    if missing and session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    for marker in sorted(config.stash[REQUIRED] - config.stash[PASSED]):
        terminalreporter.write_line(f"REQUIRED: no test marked {marker} passed", red=True)


def lacking(config: pytest.Config, marker: str, reason: str) -> Never:
    if marker in config.stash[REQUIRED]:
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def shared_data(pytestconfig: pytest.Config) -> Path:
    """The folder of captures, SII images and device descriptions, shared between projects."""
    folder = Path(os.environ.get("CATENARY_SHARED") or ROOT.parent / "shared") / "data"
    if not folder.is_dir():
        lacking(pytestconfig, "shared_data", f"no shared data: {folder} is no folder")
    return folder


@pytest.fixture(scope="session")
def tshark(pytestconfig: pytest.Config) -> str:
    """The foreign dissector's command."""
    command = shutil.which("tshark")
    if command is None:
        lacking(pytestconfig, "tshark", "tshark is not installed (package tshark)")
    return command


@pytest.fixture
def veth(pytestconfig: pytest.Config) -> Iterator[tuple[str, str]]:
    """The names of two connected network interfaces, nobody else's."""
    state = private_network.state()
    if isinstance(state, private_network.Refused):
        hint = "" if private_network.VARIABLE in os.environ else " (`make test` starts it in one)"
        lacking(pytestconfig, "wire", f"no wire: {state.reason}{hint}")
    with private_network.veth_pair() as names:
        yield names
