"""The page in a browser: what it shows, and everything it must not report."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Literal

import pytest

from tests.browser.processes import Dashboard

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Locator, Page

# Tests import this module: they are skipped if Playwright is absent.
sync_api = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed (pip install -e '.[test]')"
)
expect, PlaywrightError = sync_api.expect, sync_api.Error

SECONDS = 30_000  # [ms] generous, because a machine may be busy
WIDTHS = {390: 844, 820: 1180, 1280: 800}  # width → height
# States of an axis that the page shows as soon as it has received the first status.
KNOWN_STATE = re.compile("Operation enabled|Switch on disabled|Ready to switch on|Fault")
REPORT_VIOLATIONS = """
document.addEventListener("securitypolicyviolation", (event) =>
  console.error("CSP: " + event.violatedDirective + " " + event.blockedURI));
"""
# A connection that the server has ended does not count as an error of the page.
EXPECTED = ("net::ERR_CONNECTION_REFUSED", "WebSocket connection to")


class Operator:
    """Owner of a page and of the list of its errors.

    Args:
        context: browser context of the page.
        dashboard: server of the page.
    """

    def __init__(self, context: BrowserContext, dashboard: Dashboard) -> None:
        self.dashboard = dashboard
        self.problems: list[str] = []
        context.add_init_script(REPORT_VIOLATIONS)
        self.page: Page = context.new_page()
        self.page.set_default_timeout(SECONDS)
        self.page.on("console", self._note)
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))

    def _note(self, message: Any) -> None:
        if message.type == "error" and not any(each in message.text for each in EXPECTED):
            self.problems.append(f"{message.text} {message.location['url']}")

    def open(self, view: str = "", role: str = "operator") -> Operator:
        """Open the link of a role, then a view."""
        self.page.goto(self.dashboard.links[role])
        expect(self.page.get_by_role("navigation")).to_be_visible(timeout=SECONDS)
        if view:
            self.show(view)
        return self

    def show(self, view: str) -> None:
        self.page.get_by_role("navigation").get_by_role("link", name=view, exact=True).click()
        expect(self.page.get_by_role("main", name=view)).to_be_visible(timeout=SECONDS)

    def axis(self, name: str) -> Locator:
        """Return the card of an axis."""
        return self.page.get_by_role("region", name=name, exact=True)

    def require_enabled(self, name: str) -> None:
        """Enable an axis unless it is enabled, and answer the question of the page."""
        card = self.axis(name)
        expect(card).to_contain_text(KNOWN_STATE, timeout=SECONDS)
        if card.get_by_role("button", name="Disable", exact=True).count() == 0:
            card.get_by_role("button", name="Enable", exact=True).click()
            dialog = self.page.get_by_role("dialog")
            dialog.get_by_role("button", name="Enable", exact=True).click()
        expect(card).to_contain_text("Operation enabled", timeout=SECONDS)

    def plus(self, name: str) -> Locator:
        """Return the button that jogs an axis in positive direction."""
        return self.axis(name).locator(".jog-button").last

    def press(self, name: str) -> None:
        """Press the mouse on the jog button of an axis, and keep it pressed."""
        button = self.plus(name)
        expect(button).to_be_enabled(timeout=SECONDS)
        button.scroll_into_view_if_needed()
        button.hover()
        self.page.mouse.down()

    def has_ended(self, name: str) -> bool:
        """Return True if the last jog of an axis was refused, or has ended."""
        return self.answer(name).text_content() not in ("", "requested", "moving")

    def answer(self, name: str) -> Locator:
        """Return the text with the status of the last jog of an axis."""
        return self.axis(name).locator(".answer")


@contextmanager
def operator(
    browser: Browser,
    dashboard: Dashboard,
    *,
    width: int = 1280,
    touch: bool = False,
    scheme: Literal["light", "dark"] = "light",
) -> Iterator[Operator]:
    """Open an isolated browser context. Fail if the page has reported an error.

    Args:
        browser: the browser.
        dashboard: server of the page.
        width: width of the screen [pixels].
        touch: True for a touch screen.
        scheme: colour scheme of the system.
    """
    viewport = {"width": width, "height": WIDTHS[width]}
    context = browser.new_context(
        viewport=viewport,  # type: ignore[arg-type]
        has_touch=touch,
        is_mobile=touch,
        color_scheme=scheme,
    )
    try:
        yield (shown := Operator(context, dashboard))
        assert not shown.problems, shown.problems
    finally:
        with suppress(PlaywrightError):  # the test has killed the browser
            context.close()
