"""Quick stop: from the keyboard, from the button, from a page that holds no lease."""

from __future__ import annotations

from tests.browser.chromium import Chromium
from tests.browser.pages import SECONDS, expect, operator
from tests.browser.rig import NAMES, Rig

AXIS = NAMES[0]


def test_escape_stops_all_axes(shared_rig: Rig) -> None:
    with shared_rig.operating() as shown:
        shown.require_enabled(NAMES[1])
        assert shared_rig.jogs(shown)
        shown.page.keyboard.press("Escape")
        for axis in range(len(NAMES)):
            assert shared_rig.becomes("SWITCH ON DISABLED", axis)
        assert shared_rig.stands()
        shown.page.mouse.up()
        expect(shown.axis(AXIS)).to_contain_text("operator", timeout=SECONDS)


def test_the_button_stops_without_a_lease(shared_rig: Rig, own_browser: Chromium) -> None:
    """The stop of a second operator needs no lease of the axis that the first one jogs."""
    with (
        shared_rig.operating() as first,
        operator(own_browser.browser, shared_rig.dashboard) as second,
    ):
        second.open("Overview")
        assert shared_rig.jogs(first)
        second.page.get_by_role("button", name="Quick stop of all axes").click()
        assert shared_rig.becomes("SWITCH ON DISABLED")
        assert shared_rig.stands()
        first.page.mouse.up()


def test_the_key_works_in_a_field_and_in_a_dialog(shared_rig: Rig) -> None:
    with shared_rig.operating() as shown:
        shown.page.get_by_role("button", name="Enable all").click()
        expect(shown.page.get_by_role("dialog")).to_be_visible(timeout=SECONDS)
        shown.page.keyboard.press("Escape")
        assert shared_rig.becomes("SWITCH ON DISABLED")


def test_a_stopped_axis_needs_to_be_enabled(shared_rig: Rig) -> None:
    with shared_rig.operating() as shown:
        shown.page.keyboard.press("Escape")
        assert shared_rig.becomes("SWITCH ON DISABLED")
        expect(shown.plus(AXIS)).to_be_disabled(timeout=SECONDS)
        shown.require_enabled(AXIS)
        assert shared_rig.becomes("OPERATION ENABLED")
