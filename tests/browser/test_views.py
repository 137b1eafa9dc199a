"""Every view on a phone, a tablet and a desktop: no error, no violation of the CSP, no overflow."""

from __future__ import annotations

import pytest

from tests.browser.pages import SECONDS, WIDTHS, expect
from tests.browser.rig import Rig

VIEWS = ("Overview", "Axes", "Devices", "Scope", "Tune", "Recordings")
OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
NAMELESS = """
[...document.querySelectorAll("button, a, input, select, [role=meter]")]
  .filter((each) => each.checkVisibility() && !(each.ariaLabel || each.textContent.trim()
    || each.title || each.labels?.length || each.getAttribute("aria-labelledby")))
  .map((each) => each.outerHTML)
"""

BREAK_RULES = """() => {
  const done = [];
  try { document.body.innerHTML = "<b>x</b>"; } catch { done.push("html"); }
  const script = document.createElement("script");
  try { script.textContent = "window.ran = 1"; } catch { done.push("script"); }
  document.body.append(script);
  document.body.setAttribute("style", "color: red");
  if (getComputedStyle(document.body).color !== "rgb(255, 0, 0)") done.push("style");
  if (window.ran === undefined) done.push("run");
  return done;
}"""


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("width", WIDTHS)
def test_a_view_fits_its_screen(shared_rig: Rig, width: int, view: str) -> None:

    with shared_rig.open(width=width, touch=width < 1000) as shown:
        shown.open(view)
        page = shown.page
        stop = page.get_by_role("button", name="Quick stop of all axes")
        expect(stop).to_be_in_viewport(ratio=1, timeout=SECONDS)
        for landmark in ("banner", "navigation", "main"):
            expect(page.get_by_role(landmark).first).to_be_visible(timeout=SECONDS)
        expect(page.get_by_role("main")).not_to_be_empty()
        assert page.evaluate(OVERFLOW) == 0
        assert page.evaluate(NAMELESS) == []
        page.get_by_role("main").evaluate("main => main.scrollTo(0, 1e6)")
        expect(stop).to_be_in_viewport(ratio=1, timeout=SECONDS)


def test_the_csp_is_in_force(shared_rig: Rig) -> None:
    """Scripts and styles in the page, and HTML from strings, are refused."""
    with shared_rig.open() as shown:
        shown.open()
        with shown.page.expect_console_message(lambda message: "CSP: " in message.text):
            refused = shown.page.evaluate(BREAK_RULES)
        assert refused == ["html", "script", "style", "run"]
        shown.problems.clear()


def test_the_page_is_dark_and_light(shared_rig: Rig) -> None:
    background = "getComputedStyle(document.documentElement).backgroundColor"
    found = set()
    for scheme in ("light", "dark"):
        with shared_rig.open(scheme=scheme) as shown:
            shown.open()
            body = "getComputedStyle(document.body).backgroundColor"
            found.add((shown.page.evaluate(background), shown.page.evaluate(body)))
    assert len(found) == 2
