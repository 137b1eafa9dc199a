"""Fixtures of all tests: shared data, private network interfaces, tshark and the laboratory.

A test that uses `shared_data`, `veth`, `tshark`, `rtlab`, `chromium` or `ros2` is marked
`shared_data`, `wire`, `tshark`, `rtlab`, `browser` or `ros2`. It is skipped with a reason if the
resource is missing. If CI requires a marker (`--require MARKER`), such a skip is a failure, and at
least one test with the marker must run.
"""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Never

import hypothesis
import pytest

from catenary.realtime import private_network

ROOT = Path(__file__).resolve().parent.parent
# marker: fixture
FIXTURE_OF = {
    "shared_data": "shared_data",
    "wire": "veth",
    "tshark": "tshark",
    "rtlab": "rtlab",
    "browser": "chromium",
    "ros2": "ros2",
}
PAGE_PACKAGES = ("starlette", "uvicorn", "websockets", "segno", "httpx", "playwright")

# no deadlines, because no time is asserted; the same examples each time in CI
hypothesis.settings.register_profile(
    "catenary", max_examples=50, deadline=None, derandomize=bool(os.environ.get("CI"))
)
hypothesis.settings.load_profile("catenary")

REQUIRED = pytest.StashKey[set[str]]()
RAN = pytest.StashKey[set[str]]()
COLLECTED = pytest.StashKey[set[str]]()
REQUIRED_DID_NOT_RUN = 6  # exit status; pytest uses 0 to 5


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--require",
        action="append",
        default=[],
        choices=sorted(FIXTURE_OF),
        metavar="MARKER",
        help="fail unless tests with this marker ran "
        "(shared_data, wire, tshark, rtlab, browser, ros2)",
    )
    parser.addoption(
        "--part",
        action="store_true",
        help="another process runs the other tests: ignore required markers without a test here",
    )


def pytest_configure(config: pytest.Config) -> None:
    # A shell ignores SIGINT for background programs, which inherit this.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    config.stash[REQUIRED] = set(config.getoption("--require"))
    config.stash[RAN] = set()
    config.stash[COLLECTED] = set()


def pytest_itemcollected(item: pytest.Item) -> None:
    for marker, fixture in FIXTURE_OF.items():
        if fixture in getattr(item, "fixturenames", ()):
            item.add_marker(marker)
            item.config.stash[COLLECTED].add(marker)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.when == "call" and not report.skipped:
        item.config.stash[RAN].update(mark.name for mark in item.iter_markers())
    return report


def did_not_run(config: pytest.Config) -> set[str]:
    """Return the required markers without a test that ran."""
    required = config.stash[REQUIRED]
    if config.getoption("--part"):
        required = required & config.stash[COLLECTED]
    return required - config.stash[RAN]


def pytest_sessionfinish(session: pytest.Session) -> None:
    if did_not_run(session.config) and session.exitstatus in (
        pytest.ExitCode.OK,
        pytest.ExitCode.NO_TESTS_COLLECTED,
        pytest.ExitCode.TESTS_FAILED,
    ):
        session.exitstatus = REQUIRED_DID_NOT_RUN


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    for marker in sorted(did_not_run(config)):
        terminalreporter.write_line(f"REQUIRED: no test marked {marker} ran", red=True)


def lacking(config: pytest.Config, marker: str, reason: str) -> Never:
    if marker in config.stash[REQUIRED]:
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="session", autouse=True)
def _no_esi_library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Use an empty library of ESI files instead of the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CATENARY_ESI", str(tmp_path_factory.getbasetemp() / "esi_library"))
        yield


@pytest.fixture(scope="session")
def shared_data(pytestconfig: pytest.Config) -> Path:
    """Return the folder of captures, SII images and device descriptions shared by projects."""
    folder = Path(os.environ.get("CATENARY_SHARED") or ROOT.parent / "shared") / "data"
    if not folder.is_dir():
        lacking(pytestconfig, "shared_data", f"no shared data: {folder} is not a folder")
    return folder


@pytest.fixture(scope="session")
def tshark(pytestconfig: pytest.Config) -> str:
    """Return the command of tshark."""
    command = shutil.which("tshark")
    if command is None:
        lacking(pytestconfig, "tshark", "tshark is not installed (package tshark)")
    return command


@pytest.fixture(scope="session")
def chromium(pytestconfig: pytest.Config) -> str:
    """Return the command of Chromium. The packages of the page and Playwright are installed."""
    missing = [name for name in PAGE_PACKAGES if find_spec(name) is None]
    if missing:
        hint = "pip install -e '.[dashboard,test]'"
        lacking(pytestconfig, "browser", f"{', '.join(missing)}: not installed ({hint})")
    command = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if command is None:
        lacking(pytestconfig, "browser", "Chromium is not installed (package chromium)")
    return command


@pytest.fixture(scope="session", params=["jazzy", "kilted"])
def ros2(request: pytest.FixtureRequest, pytestconfig: pytest.Config) -> Path:
    """Return the Python of an environment with rclpy, for each distribution."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "catenary"
    folder = Path(os.environ.get("CATENARY_ROS2") or cache) / f"ros2-{request.param}"
    if not (folder / "requirements").is_file():
        lacking(pytestconfig, "ros2", f"no rclpy in {folder} (`tools/ros2_environments` makes it)")
    return folder / "bin" / "python"


@pytest.fixture
def tap(veth: tuple[str, str], pytestconfig: pytest.Config) -> Iterator[str]:
    """Yield the name of a TAP interface with the address 192.168.7.1/24."""
    name = "cattap0"
    try:
        private_network.run_ip("tuntap", "add", "dev", name, "mode", "tap")
    except OSError as error:
        lacking(pytestconfig, "wire", f"no TAP interfaces: {error}")
    try:
        private_network.disable_ipv6(name)
        private_network.run_ip("address", "add", "192.168.7.1/24", "dev", name)
        private_network.run_ip("link", "set", name, "up")
        yield name
    finally:
        private_network.run_ip("tuntap", "del", "dev", name, "mode", "tap")


@pytest.fixture
def veth(pytestconfig: pytest.Config) -> Iterator[tuple[str, str]]:
    """Yield the names of two connected private network interfaces."""
    state = private_network.state()
    if isinstance(state, private_network.Refused):
        hint = "" if private_network.VARIABLE in os.environ else " (`make test` starts it in one)"
        lacking(pytestconfig, "wire", f"no wire: {state.reason}{hint}")
    with private_network.veth_pair() as names:
        yield names
