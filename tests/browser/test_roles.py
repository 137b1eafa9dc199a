"""Roles: a viewer watches and cannot move; without a token there is no page content."""

from __future__ import annotations

import re

from tests.browser.pages import SECONDS, expect
from tests.browser.raw_client import RawClient
from tests.browser.rig import NAMES, Rig


def test_a_viewer_has_no_controls(shared_rig: Rig) -> None:

    with shared_rig.open() as shown:
        shown.open("Axes", role="viewer")
        card = shown.axis(NAMES[0])
        expect(card).to_contain_text(re.compile("enabled", re.IGNORECASE), timeout=SECONDS)
        for button in card.get_by_role("button").all():
            assert button.is_disabled()
        card.locator(".jog").press("ArrowRight")
        assert not shown.answer(NAMES[0]).text_content()


def test_the_server_refuses_motion_of_a_viewer(shared_rig: Rig) -> None:
    """The page is not needed for an attack: the server decides."""
    before = shared_rig.state()["position"]
    with RawClient(shared_rig.dashboard, "viewer") as viewer:
        hello = viewer.until("hello")
        assert hello["role"] == "viewer"
        viewer.send(op="press", axis=0, velocity=1.0, token="1", press=1)
        assert viewer.until("error")["about"] == "press"
        viewer.send(op="request", axes=None, state="disable")
        assert viewer.until("error")["about"] == "request"
    assert shared_rig.state()["position"] == before
    assert shared_rig.state()["state"] == "OPERATION ENABLED"


def test_without_a_token_the_page_asks_for_it(shared_rig: Rig) -> None:

    with shared_rig.open() as shown:
        link, _, fragment = shared_rig.dashboard.links["operator"].partition("#token=")
        shown.page.goto(link)
        field = shown.page.get_by_label("Token")
        expect(field).to_be_visible(timeout=SECONDS)
        field.fill("wrong")
        field.press("Enter")
        expect(shown.page.get_by_role("alert")).not_to_be_empty(timeout=SECONDS)
        field.fill(fragment)
        field.press("Enter")
        expect(shown.page.get_by_role("navigation")).to_be_visible(timeout=SECONDS)
        shown.problems[:] = [each for each in shown.problems if "40" not in each]  # 401, 403


def test_the_token_leaves_the_address(shared_rig: Rig) -> None:
    with shared_rig.open() as shown:
        shown.open()
        assert "token" not in shown.page.url
        assert shown.page.evaluate("document.cookie") == ""
