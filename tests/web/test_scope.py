"""The scope in a browser: every sample, exports, trigger, cursors. The server sends sines."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from benchmarks.dashboard_scope import collect_errors, layout, lost_rows
from benchmarks.synthetic_dashboard import PERIOD, serving

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

STATIC = Path(__file__).parents[2] / "src/catenary/dashboard/static"
AXES = 33
pytest.importorskip("uvicorn", reason="needs uvicorn")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with serving(STATIC, AXES) as address:
        yield address


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Page]:
    """Scope with its first arrangement; the test fails for an error of the page or its policy."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    errors = collect_errors(page)
    page.goto(f"{address}/#/scope")
    page.locator(".scope-chart").first.wait_for()
    yield page
    context.close()
    assert errors == []


def arrange(page: Page, address: str, **changes: object) -> None:
    """Open the scope again with another arrangement."""
    arrangement = json.dumps(layout(AXES) | changes)
    page.evaluate("text => localStorage.setItem('catenary.scope.synthetic', text)", arrangement)
    page.goto("about:blank")
    page.goto(f"{address}/#/scope")
    page.locator(".scope-chart").first.wait_for()


def now(page: Page) -> str:
    """Return the value of the first trace in the table."""
    return page.locator(".scope-table td").first.inner_text()


def wait_for_change(page: Page, selector: str, before: str) -> None:
    """Wait until an element has another text. The policy forbids `wait_for_function`."""
    from playwright.sync_api import expect

    expect(page.locator(selector).first).not_to_have_text(before, timeout=20_000)


def wait_for_samples(page: Page) -> None:
    wait_for_change(page, ".scope-table td", "–")


def test_198_signals_arrive_without_a_lost_sample(page: Page, address: str) -> None:
    arrange(page, address)
    wait_for_samples(page)
    page.wait_for_timeout(2000)
    assert lost_rows(page) == 0
    assert "198 signals" in page.locator(".scope-stored").inner_text()
    assert "no lost samples" in page.locator(".scope-stored").inner_text()


def test_added_signals_leave_no_gap_in_the_others(page: Page) -> None:
    wait_for_samples(page)
    page.wait_for_timeout(500)
    page.locator(".scope-picker summary", has_text="torque").first.click()
    page.get_by_label("axis 3", exact=True).check()
    page.wait_for_timeout(1000)
    page.get_by_role("button", name="Pause").click()
    page.locator(".scope-menu summary").click()
    page.locator(".scope-menu select").select_option("true")
    with page.expect_download() as download:
        page.get_by_role("button", name="CSV").click()
    rows = list(csv.reader(download.value.path().open(newline="")))
    cycles = [round(float(row[0]) / PERIOD) for row in rows[1:]]
    added = rows[0].index("torque · axis 3 [N·m]")
    assert cycles == list(range(cycles[0], cycles[0] + len(cycles)))
    assert all(cell for row in rows[1:] for at, cell in enumerate(row) if at != added)
    assert rows[1][added] == ""
    assert rows[-1][added] != ""


def test_mcap_export_opens(page: Page) -> None:
    reader = pytest.importorskip("mcap.reader", reason="needs mcap")
    wait_for_samples(page)
    page.wait_for_timeout(500)
    page.get_by_role("button", name="Pause").click()
    page.locator(".scope-menu summary").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="MCAP").click()
    data = download.value.path().read_bytes()
    messages = list(reader.make_reader(BytesIO(data)).iter_messages())
    assert len(messages) > 300
    schema, channel, message = messages[0]
    assert (schema.encoding, channel.topic) == ("jsonschema", "/scope")
    names = set(json.loads(schema.data)["properties"])
    sample = json.loads(message.data)
    assert set(sample) == names
    assert message.log_time == pytest.approx(sample["time"] * 1e9, abs=1000)
    times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)


def test_pause_keeps_the_samples_and_run_continues(page: Page) -> None:
    wait_for_samples(page)
    page.get_by_role("button", name="Pause").click()
    page.wait_for_timeout(200)
    before = now(page)
    page.wait_for_timeout(500)
    assert now(page) == before
    page.get_by_role("button", name="Run", exact=True).click()
    wait_for_change(page, ".scope-table td", before)


def test_single_trigger_captures_once(page: Page) -> None:
    wait_for_samples(page)
    page.get_by_label("Window").select_option("0.2")
    page.get_by_label("Trigger").check()
    page.get_by_label("Mode").select_option("single")
    page.get_by_text("complete").wait_for()
    page.get_by_text("seconds from the trigger").wait_for()
    assert page.get_by_role("button", name="Run", exact=True).is_visible()
    before = now(page)
    page.wait_for_timeout(500)
    assert now(page) == before


def test_zoom_by_dragging_pauses_and_double_click_runs(page: Page) -> None:
    wait_for_samples(page)
    box = page.locator(".u-over").first.bounding_box()
    assert box is not None
    y = box["y"] + 40
    page.mouse.move(box["x"] + 200, y)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, y, steps=4)
    page.mouse.up()
    page.get_by_role("button", name="Run", exact=True).wait_for()
    page.mouse.dblclick(box["x"] + 50, y)
    page.get_by_role("button", name="Pause").wait_for()


def test_cursors_show_the_difference(page: Page) -> None:
    wait_for_samples(page)
    page.get_by_role("button", name="Cursors").click()
    line = page.locator(".scope-cursors")
    line.wait_for()
    before = line.inner_text()
    assert "Δ 1.67" in before
    page.locator(".scope-plot").first.focus()
    page.keyboard.press("Shift+ArrowLeft")
    wait_for_change(page, ".scope-cursors", before)


def test_arrangement_survives_a_reload(page: Page) -> None:
    page.get_by_role("button", name="Add chart").click()
    assert page.locator(".scope-chart").count() == 3
    page.reload()
    page.locator(".scope-chart").first.wait_for()
    assert page.locator(".scope-chart").count() == 3


def test_png_export_is_an_image(page: Page) -> None:
    wait_for_samples(page)
    page.locator(".scope-menu summary").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="PNG").click()
    assert download.value.path().read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("width", [390, 820, 1280])
def test_scope_fits_the_width(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 844})
    wait_for_samples(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    box = page.locator(".scope-plot").first.bounding_box()
    assert box is not None
    assert box["width"] > 0.6 * min(width, 820) - 100
