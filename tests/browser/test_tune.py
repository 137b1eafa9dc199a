"""Tune in a browser: step, sweep and identification of a virtual servo, and what ends them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tests.browser.pages import SECONDS, Operator, expect
from tests.browser.rig import NAMES, PRESSES, Rig

if TYPE_CHECKING:
    from playwright.sync_api import Locator

AXIS = NAMES[0]
STEP = 0.05  # [rad]


@contextmanager
def tuning(rig: Rig) -> Iterator[Operator]:
    """Open the tests of an enabled axis."""
    with rig.operating(AXIS) as shown:
        shown.show("Tune")
        yield shown


def panel(shown: Operator, name: str) -> Locator:
    return shown.page.get_by_role("region", name=name, exact=True)


def fill(place: Locator, **values: float) -> None:
    for label, value in values.items():
        entry = place.get_by_label(label)
        entry.fill(str(value))
        entry.blur()


def hold(shown: Operator, place: Locator, label: str) -> None:
    """Press the mouse on a button until the axis moves: a busy machine may refuse a press."""
    answer = place.get_by_role("status").first
    for _ in range(PRESSES):
        place.get_by_role("button", name=label).hover()
        shown.page.mouse.down()
        expect(answer).not_to_be_empty(timeout=SECONDS)
        if answer.text_content() in ("moving", "the motion is complete"):
            return
        shown.page.mouse.up()
    raise AssertionError(f"the axis did not move: {answer.text_content()}")


def complete(shown: Operator, place: Locator, label: str) -> None:
    """Hold a button until the motion is complete: the heartbeats of a busy machine may expire."""
    answer = place.get_by_role("status").first
    for _ in range(PRESSES):
        hold(shown, place, label)
        expect(answer).to_have_text(re.compile("complete|stopped"), timeout=SECONDS)
        shown.page.mouse.up()
        if answer.text_content() == "the motion is complete":
            return
    raise AssertionError(f"the motion did not complete: {answer.text_content()}")


def test_a_step_has_a_distance_and_figures(local: Rig) -> None:
    with tuning(local) as shown:
        place = panel(shown, "Step response")
        fill(place, Distance=STEP)
        complete(shown, place, "Hold to step +")
        expect(place.locator("dl")).to_contain_text("0.05", timeout=SECONDS)
        expect(place.locator("canvas").first).to_be_visible()
        assert local.stands()


def test_a_sweep_shows_its_response_and_identifies_the_axis(local: Rig) -> None:
    with tuning(local) as shown:
        place = panel(shown, "Frequency response")
        fill(place, Start=2, End=20, Duration=4)
        complete(shown, place, "Hold to sweep")
        expect(place.get_by_role("img", name="Phase [°]")).to_be_visible(timeout=SECONDS)
        expect(place.locator("dl")).to_contain_text("Phase margin")
        assert local.stands()
        found = panel(shown, "Identification")
        expect(found.get_by_role("link", name="Report of this axis")).to_be_visible(timeout=SECONDS)
        with shown.page.context.expect_page() as opened:
            found.get_by_role("link", name="Report of this axis").click()
        expect(opened.value.get_by_role("table")).to_contain_text(AXIS)


def test_the_release_ends_a_sweep(shared_rig: Rig) -> None:
    with tuning(shared_rig) as shown:
        place = panel(shown, "Frequency response")
        fill(place, Duration=60)
        hold(shown, place, "Hold to sweep")
        assert shared_rig.moves()
        shown.page.mouse.up()
        expect(place.get_by_role("status").first).to_have_text(
            re.compile("released|stopped"), timeout=SECONDS
        )
        assert shared_rig.stands()


def test_a_change_of_the_view_ends_a_sweep(shared_rig: Rig) -> None:
    with tuning(shared_rig) as shown:
        place = panel(shown, "Frequency response")
        fill(place, Duration=60)
        hold(shown, place, "Hold to sweep")
        assert shared_rig.moves()
        shown.page.evaluate("location.hash = '#/overview'")
        assert shared_rig.stands()


def test_an_axis_without_power_is_not_tested(shared_rig: Rig) -> None:
    with tuning(shared_rig) as shown:
        bar = shown.page.locator(".tune-axis")
        bar.get_by_role("button", name="Disable", exact=True).click()
        button = shown.page.get_by_role("button", name="Hold to sweep")
        expect(button).to_be_disabled(timeout=SECONDS)
        expect(bar).to_contain_text("require that the axis is enabled")
