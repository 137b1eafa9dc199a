"""The 3D view without a scene, in Chromium against a fake server."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

pytest.importorskip("playwright.sync_api", reason="needs playwright")

from playwright.sync_api import Page, expect

from tests.web.fake_server import ORIGIN, FakeServer

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SECONDS = 30_000  # [ms] generous, because a machine may be busy


def open_axes(page: Page) -> None:
    page.goto(f"{ORIGIN}/#/axes")
    expect(page.get_by_role("region", name="joint_1")).to_be_visible(timeout=SECONDS)


def test_a_model_that_cannot_be_shown_has_a_reason(browser: Browser) -> None:
    page = browser.new_page()
    FakeServer(page).scene_problem = "the model has no free joint, so its base cannot move"
    open_axes(page)
    scene = page.get_by_role("region", name="3D")
    expect(scene).to_contain_text("The model cannot be shown: the model has no free joint")
    page.close()


def test_a_server_without_a_model_shows_no_view(browser: Browser) -> None:
    page = browser.new_page()
    FakeServer(page)
    with page.expect_response("**/scene", timeout=SECONDS):
        open_axes(page)
    expect(page.get_by_role("region", name="3D")).to_have_count(0)
    page.close()
