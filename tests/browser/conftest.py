"""Fixtures: Chromium, and machines with a page. Skipped where one of them is absent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from tests.browser.rig import Rig, local_rig, wired_rig

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Playwright

    from tests.browser.chromium import Chromium


@pytest.fixture(scope="module")
def playwright(chromium: str) -> Iterator[Playwright]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        yield started


@pytest.fixture(scope="module")
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


@pytest.fixture(scope="module")
def shared_rig(browser: Browser) -> Iterator[Rig]:
    """Machine of all tests that leave it and its page intact."""
    with ExitStack() as stack:
        yield local_rig(stack, browser)


@pytest.fixture
def local(browser: Browser) -> Iterator[Rig]:
    """Machine of one test, with the servos in the process of its loop."""
    with ExitStack() as stack:
        yield local_rig(stack, browser)


@pytest.fixture
def wired(browser: Browser, veth: tuple[str, str]) -> Iterator[Rig]:
    """Machine of one test, with the servos in another process."""
    with ExitStack() as stack:
        yield wired_rig(stack, browser, *veth)
