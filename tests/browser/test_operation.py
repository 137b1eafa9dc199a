"""Operating modes and presets, from the buttons of a page to the program of the loop."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

import catenary as cat
from tests.browser.machine import REFUSAL
from tests.browser.pages import SECONDS, Operator, expect
from tests.browser.rig import Rig, local_rig
from tests.share.processes import comes_true

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator


@pytest.fixture(scope="module")
def rig(browser: Browser) -> Iterator[Rig]:
    """Machine whose program offers operating modes and presets."""
    with ExitStack() as stack:
        yield local_rig(stack, browser, modes=True)


def panel(shown: Operator) -> Locator:
    return shown.page.get_by_role("region", name="Operation", exact=True)


def result(shown: Operator) -> Locator:
    return panel(shown).get_by_role("status")


def hold(shown: Operator, name: str) -> None:
    """Hold a button with the mouse until the page reports the answer."""
    button = panel(shown).get_by_role("button", name=name)
    expect(button).to_be_enabled(timeout=SECONDS)
    button.hover()
    shown.page.mouse.down()
    expect(result(shown)).to_contain_text(name, timeout=SECONDS)
    shown.page.mouse.up()


def test_a_mode_reaches_the_program_and_all_pages(rig: Rig) -> None:
    with (
        rig.open() as shown,
        rig.open(width=390, touch=True) as phone,
        cat.attach(rig.share) as arm,
    ):
        phone.open(role="viewer")
        hold(shown.open(), "stand")
        expect(result(shown)).to_contain_text("accepted Mode stand")
        assert comes_true(lambda: arm.mode == "stand")
        for each in (shown, phone):
            button = panel(each).get_by_role("button", name="stand")
            expect(button).to_have_attribute("aria-pressed", "true", timeout=SECONDS)
            expect(each.page.get_by_role("banner")).to_contain_text("stand")
        assert panel(phone).get_by_role("button", disabled=False).count() == 0


def test_a_preset_becomes_an_event_with_the_client(rig: Rig) -> None:
    with rig.open() as shown:
        hold(shown.open(), "wave")
        expect(result(shown)).to_contain_text("accepted Preset wave")
        events = shown.page.get_by_role("region", name="Events")
        expect(events).to_contain_text("requested preset 'wave': accepted", timeout=SECONDS)


def test_a_refusal_shows_the_reason_of_the_program(rig: Rig) -> None:
    with rig.open() as shown:
        hold(shown.open("Axes"), "balance")
        expect(result(shown)).to_contain_text(f"refused Mode balance: {REFUSAL}")
        shown.problems.clear()  # the browser reports the refused request


def test_a_program_that_does_not_answer_is_reported_and_the_stop_works(rig: Rig) -> None:
    with rig.open() as shown:
        shown.open("Axes")
        expect(panel(shown).get_by_role("button", name="home")).to_be_enabled(timeout=SECONDS)
        rig.loop.tell("stall")
        try:
            hold(shown, "home")
            expect(result(shown)).to_contain_text("not answered Preset home", timeout=SECONDS)
            shown.page.keyboard.press("Escape")
            expect(shown.page.get_by_role("button", name="Quick stop")).to_contain_text("sent")
        finally:
            rig.loop.tell("resume")
        shown.problems.clear()  # the browser reports the refused request
