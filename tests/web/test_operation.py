"""Operating modes and presets of the page in Chromium, against a fake server.

The time of the page stands still, unless a test lets it pass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("playwright.sync_api", reason="needs playwright")

from playwright.sync_api import Locator, Page, expect

from tests.web.fake_server import ORIGIN, FakeServer, Message, Refusal

if TYPE_CHECKING:
    from playwright.sync_api import Browser

HOLD = 600  # [ms]
MODES = {"damping": "hold softly", "stand": "", "balance": "react to pushes"}
PRESETS = {"home": "", "wave": "wave with the left arm"}
Opened = tuple[Page, FakeServer]


def open_page(
    page: Page,
    server: FakeServer,
    view: str = "overview",
    *,
    more: dict[str, str] | None = None,
    mode: str = "damping",
) -> None:
    server.modes, server.presets = {**MODES, **(more or {})}, dict(PRESETS)
    server.mode = mode
    page.clock.install(time=0)
    page.goto(f"{ORIGIN}/#/{view}")
    expect(page.get_by_text("connected", exact=True)).to_be_visible()
    expect(choice(page, "damping")).to_be_visible()
    page.clock.pause_at(page.evaluate("Date.now() / 1000 + 1"))  # [s]
    give_status(page, server)


def give_status(page: Page, server: FakeServer) -> None:
    """Send a status, and wait until the page shows it."""
    server.send_status()
    number = f"{server.number:,}".replace(",", "\u202f")
    expect(page.get_by_role("banner").get_by_text(number)).to_be_visible()


@pytest.fixture
def opened(browser: Browser) -> Iterator[Opened]:
    page = browser.new_page(viewport={"width": 1280, "height": 860})
    server = FakeServer(page)
    open_page(page, server)
    yield page, server
    page.close()


def choice(page: Page, name: str) -> Locator:
    return page.get_by_role("region", name="Operation").get_by_role("button", name=name)


def requests(server: FakeServer) -> list[Message]:
    return [each for each in server.calls if each["method"] in ("set_mode", "run_preset")]


def hold(page: Page, name: str, time: int = HOLD) -> None:
    """Hold the button of a mode or preset with the mouse."""
    choice(page, name).hover()
    page.mouse.down()
    page.clock.run_for(time)
    page.mouse.up()


def result(page: Page) -> Locator:
    return page.get_by_role("region", name="Operation").get_by_role("status")


def refusing(kind: str, message: str) -> Callable[[Message], object]:
    def method(_: Message) -> object:
        raise Refusal(kind, message)

    return method


def test_the_present_mode_is_shown_and_follows_the_program(opened: Opened) -> None:
    page, server = opened
    expect(choice(page, "damping")).to_have_attribute("aria-pressed", "true")
    expect(choice(page, "stand")).to_have_attribute("aria-pressed", "false")
    expect(page.get_by_role("banner")).to_contain_text("damping")
    server.mode = "stand"
    server.send_status()
    expect(choice(page, "stand")).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_role("banner")).to_contain_text("stand")


def test_a_complete_hold_requests_a_mode_once(opened: Opened) -> None:
    page, server = opened
    hold(page, "stand", 3 * HOLD)
    expect(result(page)).to_contain_text("accepted Mode stand")
    assert requests(server) == [{"method": "set_mode", "params": {"mode": "stand"}}]


def test_a_complete_hold_requests_a_preset(opened: Opened) -> None:
    page, server = opened
    hold(page, "wave")
    expect(result(page)).to_contain_text("accepted Preset wave")
    assert requests(server) == [{"method": "run_preset", "params": {"preset": "wave"}}]


def test_a_short_press_requests_nothing(opened: Opened) -> None:
    page, server = opened
    hold(page, "stand", HOLD - 1)
    page.clock.run_for(2 * HOLD)
    assert requests(server) == []
    expect(result(page)).to_contain_text("Hold a button for 0.6 s")


@pytest.mark.parametrize("key", ["Enter", " "])
def test_a_key_is_held(opened: Opened, key: str) -> None:
    page, server = opened
    choice(page, "stand").focus()
    page.keyboard.down(key)
    page.clock.run_for(HOLD - 1)
    page.keyboard.down(key)  # a repetition
    assert requests(server) == []
    page.clock.run_for(1)
    page.keyboard.up(key)
    expect(result(page)).to_contain_text("accepted Mode stand")
    assert len(requests(server)) == 1
    expect(page.get_by_role("dialog")).to_have_count(0)


@pytest.mark.parametrize("key", ["Enter", " "])
def test_a_short_key_requests_nothing(opened: Opened, key: str) -> None:
    page, server = opened
    choice(page, "stand").focus()
    page.keyboard.press(key)
    page.clock.run_for(2 * HOLD)
    assert requests(server) == []
    expect(page.get_by_role("dialog")).to_have_count(0)


def test_the_stop_ends_a_hold(opened: Opened) -> None:
    page, server = opened
    choice(page, "stand").hover()
    page.mouse.down()
    page.keyboard.press("Escape")
    page.clock.run_for(2 * HOLD)
    page.mouse.up()
    assert len(server.of("stop")) == 1
    assert requests(server) == []


@pytest.mark.parametrize("end", ["blur", "pagehide"])
def test_a_page_without_focus_ends_a_hold(opened: Opened, end: str) -> None:
    page, server = opened
    choice(page, "stand").hover()
    page.mouse.down()
    page.evaluate("(kind) => window.dispatchEvent(new Event(kind))", end)
    page.clock.run_for(2 * HOLD)
    assert requests(server) == []


def test_a_click_without_a_pointer_asks(opened: Opened) -> None:
    """Assistive technology clicks, and cannot hold."""
    page, server = opened
    page.clock.resume()
    choice(page, "stand").evaluate("(button) => button.click()")
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Request Mode stand?")
    dialog.get_by_role("button", name="Cancel").click()
    assert requests(server) == []
    choice(page, "stand").evaluate("(button) => button.click()")
    dialog.get_by_role("button", name="Request").click()
    expect(result(page)).to_contain_text("accepted Mode stand")


@pytest.mark.parametrize(
    ("kind", "message", "shown"),
    [
        (
            "RequestRefused",
            "the robot has fallen <b>",
            "refused Mode balance: the robot has fallen <b>",
        ),
        ("ResponseTimeout", "no answer within 1 s", "not answered Mode balance: no answer"),
        ("ShareError", "the loop has ended", "failed Mode balance: the loop has ended"),
    ],
)
def test_the_answer_is_shown(opened: Opened, kind: str, message: str, shown: str) -> None:
    page, server = opened
    server.methods["set_mode"] = refusing(kind, message)
    hold(page, "balance")
    expect(result(page)).to_contain_text(shown)
    expect(choice(page, "damping")).to_have_attribute("aria-pressed", "true")
    expect(choice(page, "balance")).to_be_enabled()


def test_a_viewer_sees_the_mode_only(browser: Browser) -> None:
    page = browser.new_page()
    server = FakeServer(page)
    server.role, server.reason_no_jog = "viewer", "this link is for viewers"
    open_page(page, server, "axes")
    expect(choice(page, "damping")).to_have_attribute("aria-pressed", "true")
    for name in (*MODES, *PRESETS):
        expect(choice(page, name)).to_be_disabled()
    expect(page.get_by_role("region", name="Operation")).to_contain_text("Only operators")
    page.close()


def test_a_program_without_modes_has_no_panel(browser: Browser) -> None:
    page = browser.new_page()
    server = FakeServer(page)
    page.goto(f"{ORIGIN}/#/overview")
    expect(page.get_by_text("connected", exact=True)).to_be_visible()
    expect(page.get_by_role("region", name="Events")).to_be_visible()
    expect(page.get_by_role("region", name="Operation")).to_have_count(0)
    assert requests(server) == []
    page.close()


def test_no_request_while_the_loop_stands_still(opened: Opened) -> None:
    page, server = opened
    server.state = "stalled"
    server.send_status()
    expect(choice(page, "stand")).to_be_disabled()


def test_after_a_reconnection_the_mode_is_that_of_the_program(opened: Opened) -> None:
    page, server = opened
    hold(page, "stand")
    expect(result(page)).to_contain_text("accepted Mode stand")
    page.clock.resume()
    server.accepts = False
    server.drop()
    expect(page.get_by_text("disconnected")).to_be_visible()
    expect(page.get_by_role("banner")).to_contain_text("no mode")
    expect(choice(page, "damping")).to_have_attribute("aria-pressed", "false")
    expect(choice(page, "stand")).to_be_disabled()
    server.accepts, server.run, server.mode = True, "run-2", "balance"
    expect(choice(page, "balance")).to_have_attribute("aria-pressed", "true", timeout=15_000)
    expect(page.get_by_role("banner")).to_contain_text("balance")
    expect(result(page)).to_contain_text("Hold a button for 0.6 s")  # nothing of the former run


def test_a_touch_is_held_on_a_phone(browser: Browser) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    server = FakeServer(page)
    open_page(page, server)
    box = choice(page, "balance").bounding_box()
    assert box is not None
    assert box["height"] >= 44
    point = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    session = context.new_cdp_session(page)
    for time in (HOLD - 1, HOLD):
        session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [point]})
        expect(choice(page, "balance")).to_have_class("button hold holding")
        page.clock.run_for(time)
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        expect(choice(page, "balance")).to_have_class("button hold")
    expect(result(page)).to_contain_text("accepted Mode balance")
    assert len(requests(server)) == 1
    context.close()


@pytest.mark.parametrize("width", [390, 820, 1280])
@pytest.mark.parametrize("view", ["overview", "axes"])
def test_nothing_overflows(browser: Browser, width: int, view: str) -> None:
    page = browser.new_page(viewport={"width": width, "height": 844})
    server = FakeServer(page)
    many = {f"a mode with the number {n}": "a description of this mode " * 4 for n in range(8)}
    open_page(page, server, view, more=many, mode="a mode with the number 7")
    expect(choice(page, "balance")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    stop = page.get_by_role("button", name="Quick stop")
    expect(stop).to_be_in_viewport(ratio=1)
    facts, theme = (page.locator(each).bounding_box() for each in (".facts .mode", ".theme"))
    assert facts is not None
    assert theme is not None
    assert facts["x"] + facts["width"] <= theme["x"]
    page.close()
