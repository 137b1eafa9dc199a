"""The 3D scene and the recordings in a browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from catenary.record.file import RecordingFile
from tests.browser import processes
from tests.browser.pages import SECONDS, WIDTHS, expect, operator
from tests.browser.rig import NAMES, Rig
from tests.record.made import make_layout, make_rows

if TYPE_CHECKING:
    from playwright.sync_api import Browser

    from tests.browser.pages import Operator

MODEL = """<mujoco><worldbody><geom type="plane" size="50 50 .1"/>
<body pos="0 0 .5"><joint name="shoulder" axis="0 0 1"/><geom type="box" size=".1 .1 .5"/>
<body pos="0 0 .5"><joint name="elbow" axis="0 1 0"/>
<geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/></body></body></worldbody></mujoco>"""


@contextmanager
def paged(rig: Rig, browser: Browser, *options: str, width: int = 1280) -> Iterator[Operator]:
    """Open a page of another dashboard of the same share, with more panels."""
    with ExitStack() as stack:
        dashboard = stack.enter_context(processes.dashboard(rig.share, *options))
        yield stack.enter_context(operator(browser, dashboard, width=width, touch=width < 500))


@pytest.fixture
def model(tmp_path: Path) -> str:
    pytest.importorskip("mujoco")
    path = tmp_path / "arm.xml"
    path.write_text(MODEL)
    return str(path)


@pytest.fixture
def folder(tmp_path: Path) -> str:
    layout = make_layout(len(NAMES))
    file = RecordingFile(tmp_path / "arm.mcap", layout)
    file.write(make_rows(layout, 3000))
    file.finish({"ended": "the loop ended", "lost": 0})
    return str(tmp_path)


def test_the_scene_is_first_on_a_desktop(shared_rig: Rig, browser: Browser, model: str) -> None:
    with paged(shared_rig, browser, "--model", model) as shown:
        shown.open("Axes")
        scene = shown.page.get_by_role("region", name="3D", exact=True)
        expect(scene.locator("canvas")).to_be_visible(timeout=SECONDS)
        box, card = scene.bounding_box(), shown.axis(NAMES[0]).bounding_box()
        assert box is not None
        assert card is not None
        assert box["y"] < card["y"]
        scene.get_by_role("button", name="Hide").click()
        expect(scene.locator("canvas")).to_have_count(0)


def test_the_scene_is_last_and_closed_on_a_phone(
    shared_rig: Rig, browser: Browser, model: str
) -> None:
    with paged(shared_rig, browser, "--model", model, width=390) as shown:
        shown.open("Axes")
        scene = shown.page.get_by_role("region", name="3D", exact=True)
        expect(scene).to_be_visible(timeout=SECONDS)
        expect(scene.locator("canvas")).to_have_count(0)
        box, card = scene.bounding_box(), shown.axis(NAMES[-1]).bounding_box()
        assert box is not None
        assert card is not None
        assert box["y"] > card["y"]
        scene.get_by_role("button", name="Show").click()
        expect(scene.locator("canvas")).to_be_visible(timeout=SECONDS)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_recording_is_opened_and_drawn(
    shared_rig: Rig, browser: Browser, folder: str, width: int
) -> None:
    with paged(shared_rig, browser, "--recordings", folder, width=width) as shown:
        shown.open("Recordings")
        shown.page.get_by_role("link", name="arm.mcap").click()
        expect(shown.page.locator(".recording canvas").first).to_be_visible(timeout=SECONDS)
        expect(shown.page.locator(".recording")).to_contain_text("3.00 s · 2 axes")
        shown.page.get_by_role("link", name="All recordings").click()
        expect(shown.page.get_by_role("table")).to_contain_text("arm.mcap", timeout=SECONDS)


def test_a_broken_recording_has_a_reason(shared_rig: Rig, browser: Browser, folder: str) -> None:
    (Path(folder) / "broken.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(1000))
    with paged(shared_rig, browser, "--recordings", folder) as shown:
        shown.open("Recordings")
        shown.page.get_by_role("link", name="broken.mcap").click()
        expect(shown.page.get_by_role("alert")).not_to_be_empty(timeout=SECONDS)
        shown.problems.clear()  # the browser reports the refused request
