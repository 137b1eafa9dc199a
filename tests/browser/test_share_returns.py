"""The share ends and comes back, with other axes, while the page stays open."""

from __future__ import annotations

from contextlib import ExitStack

from tests.browser import processes
from tests.browser.pages import SECONDS, expect
from tests.browser.rig import NAMES, Rig, local_rig
from tests.share.processes import DEADLINE

OTHER = ("waist", "wrist", "hand")
TALL = 10_000  # characters
MALICIOUS = (
    "<img src=x onerror=document.title=1>",
    "\u202egnp.tod\u202c",
    "x" * TALL,
    "'\"`;${7*7}</script>",
)


def test_another_layout(local: Rig) -> None:
    with local.operating() as shown, ExitStack() as stack:
        assert local.jogs(shown)
        local.loop.end()
        expect(shown.page.get_by_role("alert").first).to_contain_text("share", timeout=SECONDS)
        loop = stack.enter_context(processes.machine(local.share, OTHER))
        expect(shown.axis(OTHER[2])).to_be_visible(timeout=SECONDS)
        expect(shown.axis(NAMES[0])).to_have_count(0)
        assert all(abs(axis["velocity"]) < 1e-2 for axis in loop.ask("state"))  # no old jog
        shown.page.mouse.up()
        shown.press(OTHER[2])
        expect(shown.answer(OTHER[2])).to_contain_text("moving", timeout=SECONDS)
        shown.page.mouse.up()
        expect(shown.answer(OTHER[2])).to_have_text("released", timeout=SECONDS)


def test_server_before_the_loop(local: Rig) -> None:
    """A page that opens before the program of the loop works as soon as the program runs."""
    local.loop.end()
    assert local.loop.process.wait(DEADLINE) is not None
    with local.open() as shown, ExitStack() as stack:
        shown.open()
        expect(shown.page.get_by_role("alert").first).to_be_visible(timeout=SECONDS)
        stack.enter_context(processes.machine(local.share, NAMES))
        expect(shown.page.get_by_role("alert")).to_have_count(0, timeout=SECONDS)
        shown.show("Axes")
        expect(shown.axis(NAMES[0])).to_be_visible(timeout=SECONDS)


def test_malicious_names(browser: object) -> None:
    """Names are text: no element, no script, no overflow, and the axes still work."""
    with ExitStack() as stack:
        rig = local_rig(stack, browser, MALICIOUS)  # type: ignore[arg-type]
        with rig.open(width=390) as shown:
            shown.open("Axes")
            title = shown.page.title()
            expect(shown.page.get_by_role("region").first).to_be_visible(timeout=SECONDS)
            shown.axis(MALICIOUS[0]).locator(".jog").scroll_into_view_if_needed()
            assert shown.page.locator("main img, main script").count() == 0
            for view in ("Overview", "Devices", "Scope", "Axes"):
                shown.show(view)
                overflow = "document.documentElement.scrollWidth - innerWidth"
                assert shown.page.evaluate(overflow) <= 0
            assert shown.page.title() == title
            assert shown.page.get_by_role("region").count() >= len(MALICIOUS)
