"""Fixtures: Chromium, and a machine with a page. Skipped where Playwright or Chromium is absent."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import pytest

from tests.browser import processes
from tests.browser.processes import Dashboard, Process
from tests.share.names import own_name
from tests.share.processes import comes_true

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Playwright

    from tests.browser.chromium import Chromium
    from tests.browser.pages import Operator

STANDSTILL = 1e-2  # [rad/s]
NAMES = ("shoulder", "elbow")


@pytest.fixture(scope="session")
def playwright(chromium: str) -> Iterator[Playwright]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        yield started


@pytest.fixture(scope="session")
def browser(playwright: Playwright, chromium: str) -> Iterator[Browser]:
    """Browser of all tests that do not stop or kill it."""
    from tests.browser.chromium import started

    with started(playwright, chromium) as running:
        yield running.browser


@pytest.fixture
def own_browser(playwright: Playwright, chromium: str) -> Iterator[Chromium]:
    """Browser of one test, which may stop or kill it."""
    from tests.browser.chromium import started

    with started(playwright, chromium) as running:
        yield running


@dataclass
class Rig:
    """A machine with servos, its page, and the servos' own state."""

    share: str
    loop: Process
    servos: Process  # the process that contains the servos
    dashboard: Dashboard
    open: Callable[..., AbstractContextManager[Operator]]
    interface: str = ""
    names: tuple[str, ...] = NAMES
    stack: ExitStack = field(default_factory=ExitStack)

    def state(self, axis: int = 0) -> dict[str, object]:
        """Return the state of a servo itself."""
        return self.servos.ask("state")[axis]

    def velocity(self, axis: int = 0) -> float:
        return abs(float(self.state(axis)["velocity"]))  # type: ignore[arg-type]

    def moves(self, axis: int = 0) -> bool:
        """Wait until a servo moves. Return False if it does not."""
        return comes_true(lambda: self.velocity(axis) > 10 * STANDSTILL)

    @contextmanager
    def operating(self, axis: str = NAMES[0], **options: object) -> Iterator[Operator]:
        """Open the axes of the page, with this axis enabled."""
        with self.open(**options) as shown:
            shown.open("Axes").require_enabled(axis)
            yield shown

    def stands(self, axis: int = 0) -> bool:
        """Wait until a servo stands still. Return False if it does not."""
        return comes_true(lambda: self.velocity(axis) < STANDSTILL)


@pytest.fixture(scope="package")
def shared_rig(browser: Browser) -> Iterator[Rig]:
    """Machine of all tests that leave it and its page intact."""
    with ExitStack() as stack:
        yield local_rig(stack, browser)


@pytest.fixture
def local(browser: Browser) -> Iterator[Rig]:
    """Machine of one test, with the servos in the process of its loop."""
    with ExitStack() as stack:
        yield local_rig(stack, browser)


def local_rig(stack: ExitStack, browser: Browser, names: tuple[str, ...] = NAMES) -> Rig:
    from tests.browser.pages import operator

    share = stack.enter_context(own_name("browser"))
    loop = stack.enter_context(processes.machine(share, names))
    dashboard = stack.enter_context(processes.dashboard(share))
    opener = partial(operator, browser, dashboard)
    return Rig(share, loop, loop, dashboard, opener, names=names)


@pytest.fixture
def wired(browser: Browser, veth: tuple[str, str]) -> Iterator[Rig]:
    """Machine whose servos are in another process, at the other end of a wire."""
    from tests.browser.pages import operator

    near, far = veth
    with ExitStack() as stack:
        share = stack.enter_context(own_name("browser"))
        servos = stack.enter_context(processes.servos_on(far, NAMES))
        loop = stack.enter_context(processes.machine(share, NAMES, near))
        dashboard = stack.enter_context(processes.dashboard(share))
        opener = partial(operator, browser, dashboard)
        yield Rig(share, loop, servos, dashboard, opener, near, stack=stack)
