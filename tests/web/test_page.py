"""Behaviour of the page in Chromium, against a fake server."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("playwright.sync_api", reason="needs playwright")

from playwright.sync_api import Page, expect

from tests.web.fake_server import ORIGIN, FakeServer

if TYPE_CHECKING:
    from playwright.sync_api import Browser

WIDTHS = (390, 820, 1280)
VIEWS = ("overview", "axes", "devices", "devices/4")
SETTLE = 120  # time in which the page would send a wrong message [ms]

HELD_TIME = "window.testTime = 1000; performance.now = () => window.testTime;"

Opened = tuple[Page, FakeServer]


@pytest.fixture
def opened(browser: Browser) -> Iterator[Opened]:
    """A page that is connected, in the view of the axes."""
    page = browser.new_page(viewport={"width": 1280, "height": 860})
    page.add_init_script(HELD_TIME)
    server = FakeServer(page)
    open_view(page, "axes")
    yield page, server
    page.close()


def open_view(page: Page, view: str) -> None:
    page.goto(f"{ORIGIN}/#/{view}")
    expect(page.get_by_text("connected", exact=True)).to_be_visible()


def hold_jog(page: Page, server: FakeServer) -> None:
    """Hold the button that moves the first axis in positive direction."""
    give_token(page, server, "t1")
    page.get_by_role("button", name="Jog joint_1 in positive").hover()
    page.mouse.down()
    wait_for(page, server, "press")


def give_token(page: Page, server: FakeServer, token: str) -> None:
    """Send a token, and wait until the page shows the status that was sent after it."""
    server.send_token(token)
    server.send_status()
    number = f"{server.number:,}".replace(",", "\u202f")
    expect(page.get_by_role("banner").get_by_text(number)).to_be_visible()


def wait_for(page: Page, server: FakeServer, op: str, count: int = 1) -> None:
    """Wait for messages of the page."""
    for _ in range(500):
        if len(server.of(op)) >= count:
            return
        page.wait_for_timeout(10)
    pytest.fail(f"the page sent no {op!r}: {server.received}")


def test_held_button_sends_a_press_and_echoes_each_token(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    server.send_token("t2")
    server.send_token("t3")
    wait_for(page, server, "beat", 2)
    assert server.of("press") == [
        {
            "op": "press",
            "axis": 0,
            "velocity": pytest.approx(0.314),
            "distance": None,
            "acceleration": None,
            "token": "t1",
            "press": 1,
        }
    ]
    assert [beat["token"] for beat in server.of("beat")] == ["t2", "t3"]


def test_jog_continues_while_the_axis_does_not_follow_the_application(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    server.jogged = True
    server.send_status()
    page.wait_for_timeout(SETTLE)
    server.send_token("t2")
    wait_for(page, server, "beat")
    assert server.of("release") == []


DISPATCH = """([kind, target]) => {
    const button = document.querySelector(".jog-button.held");
    const goal = { window, document, button }[target];
    goal.dispatchEvent(new Event(kind, { bubbles: target === "button" }));
}"""
HIDE = """() => {
    Object.defineProperty(document, "hidden", { value: true, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
}"""


@pytest.mark.parametrize(
    ("kind", "target"),
    [
        ("pointerup", "button"),
        ("pointercancel", "button"),
        ("lostpointercapture", "button"),
        ("blur", "window"),
        ("pagehide", "window"),
        ("freeze", "document"),
    ],
)
def test_event_releases_the_jog(opened: Opened, kind: str, target: str) -> None:
    page, server = opened
    hold_jog(page, server)
    page.evaluate(DISPATCH, [kind, target])
    assert_released(page, server)


def test_hidden_page_releases_the_jog(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    page.evaluate(HIDE)
    assert_released(page, server)


def test_another_view_releases_the_jog(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    page.evaluate("location.hash = '#/overview'")
    assert_released(page, server)


def test_quick_stop_releases_the_jog_and_comes_first(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    page.keyboard.press("Escape")
    assert_released(page, server)
    assert [m["op"] for m in server.received if m["op"] in ("stop", "release")] == [
        "stop",
        "release",
    ]


def assert_released(page: Page, server: FakeServer) -> None:
    """Check that the page released the jog, and that later tokens do not continue it."""
    wait_for(page, server, "release")
    beats = len(server.of("beat"))
    for token in ("t8", "t9"):
        server.send_token(token)
        page.wait_for_timeout(SETTLE // 2)
    assert server.of("release") == [{"op": "release", "axis": 0, "press": 1}]
    assert len(server.of("beat")) == beats
    assert len(server.of("press")) == 1


def test_release_of_the_first_of_two_mouse_buttons_releases_the_jog(opened: Opened) -> None:
    """While another button is down, browsers send no pointerup for the first."""
    page, server = opened
    hold_jog(page, server)
    page.mouse.down(button="right")
    page.mouse.up(button="left")
    assert_released(page, server)
    page.mouse.up(button="right")


def test_another_modifier_key_releases_a_jog_by_keyboard(opened: Opened) -> None:
    """MacOS sends no keyup for a key that goes up while Meta is down."""
    page, server = opened
    give_token(page, server, "t1")
    page.get_by_role("group", name="Jog joint_1").focus()
    page.keyboard.down("ArrowRight")
    wait_for(page, server, "press")
    page.keyboard.down("Meta")
    assert_released(page, server)
    page.keyboard.up("Meta")


def test_mouse_over_the_button_does_not_release_a_jog_by_keyboard(opened: Opened) -> None:
    page, server = opened
    give_token(page, server, "t1")
    page.get_by_role("group", name="Jog joint_1").focus()
    page.keyboard.down("ArrowRight")
    wait_for(page, server, "press")
    page.get_by_role("button", name="Jog joint_1 in positive").hover()
    server.send_token("t2")
    wait_for(page, server, "beat")
    assert server.of("release") == []
    page.keyboard.up("ArrowRight")
    wait_for(page, server, "release")


def test_open_question_releases_the_jog(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    page.evaluate(
        "[...document.querySelectorAll('button')].find(b => b.textContent == 'Enable').click()"
    )
    expect(page.get_by_role("dialog")).to_be_visible()
    assert_released(page, server)


def test_late_tokens_release_the_jog(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    page.evaluate("window.testTime += 250")
    server.send_token("late")
    assert_released(page, server)


def test_held_arrow_key_jogs_the_focused_axis(opened: Opened) -> None:
    page, server = opened
    give_token(page, server, "t1")
    page.get_by_role("group", name="Jog joint_2").focus()
    page.keyboard.down("ArrowLeft")
    page.keyboard.down("ArrowLeft")  # a repetition
    wait_for(page, server, "press")
    page.keyboard.up("ArrowLeft")
    wait_for(page, server, "release")
    (press,) = server.of("press")
    assert press["axis"] == 1
    assert press["velocity"] < 0


def test_refused_jog_shows_the_text_of_the_server(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    refusal = "the axis is in CST; jogs need CSP, CSV or PV"
    server.send({"op": "jog", "axis": 0, "press": 1, "status": "REFUSED_MODE", "text": refusal})
    expect(page.get_by_text(refusal)).to_be_visible()
    server.send_token("t2")
    page.wait_for_timeout(SETTLE)
    assert server.of("beat") == []


def test_jog_on_a_touch_screen_needs_two_touches(browser: Browser) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    page.add_init_script(HELD_TIME)
    server = FakeServer(page)
    open_view(page, "axes")
    give_token(page, server, "t1")
    jog = centre(page, "Jog joint_1 in positive")
    pad = centre(page, "HOLD TO ENABLE")
    session = context.new_cdp_session(page)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        touches = [{"x": x, "y": y, "id": at} for at, (x, y) in enumerate(points)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

    touch("touchStart", jog)
    expect(page.get_by_text("Hold the enable field")).to_be_visible()
    touch("touchEnd")
    assert server.of("press") == []
    give_token(page, server, "t2")
    touch("touchStart", pad)
    touch("touchStart", pad, jog)
    wait_for(page, server, "press")
    touch("touchEnd", pad)
    wait_for(page, server, "release")
    context.close()


def centre(page: Page, name: str) -> tuple[float, float]:
    box = page.get_by_role("button", name=name).bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_escape_stops_in_an_input_and_in_a_dialog(opened: Opened) -> None:
    page, server = opened
    page.get_by_label("Speed").focus()
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Enable", exact=True).first.click()
    page.keyboard.press("Escape")
    wait_for(page, server, "stop", 2)
    page.wait_for_timeout(SETTLE)
    assert len(server.of("stop")) == 2
    assert server.of("request") == []


def test_stop_button_reacts_to_the_press(opened: Opened) -> None:
    page, server = opened
    page.get_by_role("button", name="Quick stop").hover()
    page.mouse.down()
    wait_for(page, server, "stop")
    page.mouse.up()
    page.wait_for_timeout(SETTLE)
    assert len(server.of("stop")) == 1


def test_stop_button_works_with_the_keyboard(opened: Opened) -> None:
    page, server = opened
    page.get_by_role("button", name="Quick stop").focus()
    page.keyboard.press("Enter")
    wait_for(page, server, "stop")
    assert len(server.of("stop")) == 1


def test_stop_that_the_server_does_not_confirm_is_reported(opened: Opened) -> None:
    page, server = opened
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Quick stop")).to_contain_text("sent")
    server.confirms = False
    page.keyboard.press("Escape")
    expect(page.get_by_text("has not confirmed the stop")).to_be_visible()


def test_stop_of_a_viewer_states_that_it_has_no_effect(browser: Browser) -> None:
    page = browser.new_page()
    server = FakeServer(page)
    server.role = "viewer"
    open_view(page, "overview")
    page.keyboard.press("Escape")
    expect(page.get_by_text("it cannot stop the axes")).to_be_visible()
    expect(page.get_by_role("button", name="Quick stop")).to_contain_text("operators only")
    assert server.of("stop") == []
    page.close()


def test_stop_without_a_connection_is_reported(opened: Opened) -> None:
    page, server = opened
    server.accepts = False
    server.drop()
    expect(page.get_by_text("disconnected")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_text("The stop was not sent")).to_be_visible()


def test_enabling_asks_first(opened: Opened) -> None:
    page, server = opened
    page.get_by_role("button", name="Enable", exact=True).first.click()
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_timeout(SETTLE)
    assert server.of("request") == []
    page.get_by_role("button", name="Enable", exact=True).first.click()
    page.get_by_role("dialog").get_by_role("button", name="Enable").click()
    wait_for(page, server, "request")
    assert server.of("request") == [
        {"op": "request", "axes": [4], "state": "enable", "run": "run-1"}
    ]


def test_question_returns_the_focus(opened: Opened) -> None:
    page, _ = opened
    enable = page.get_by_role("button", name="Enable", exact=True).first
    enable.focus()
    page.keyboard.press("Enter")
    expect(page.get_by_role("button", name="Cancel")).to_be_focused()
    page.keyboard.press("Enter")
    expect(enable).to_be_focused()


def test_question_closes_when_the_share_ends(opened: Opened) -> None:
    """The axis with the same number may be another one when the share returns."""
    page, server = opened
    page.get_by_role("button", name="Enable", exact=True).first.click()
    expect(page.get_by_role("dialog")).to_be_visible()
    server.send({"op": "gone", "reason": "the loop has ended"})
    expect(page.get_by_role("dialog")).to_be_hidden()
    assert server.of("request") == []


def test_values_without_new_statuses_are_marked_as_old(opened: Opened) -> None:
    page, server = opened
    page.evaluate("window.testTime += 2500")
    server.send_token("t1")  # the connection itself works
    expect(page.get_by_text("these are old values")).to_be_visible()
    server.send_status()
    expect(page.get_by_text("these are old values")).to_be_hidden()


def test_page_reconnects_and_subscribes_again_without_reload(opened: Opened) -> None:
    page, server = opened
    open_view(page, "devices/4")
    page.get_by_role("button", name="Live values").click()
    wait_for(page, server, "subscribe")
    page.evaluate("window.same = true")
    server.received.clear()
    server.accepts = False
    server.drop()
    expect(page.get_by_text("disconnected")).to_be_visible()
    server.accepts = True
    expect(page.get_by_text("connected", exact=True)).to_be_visible(timeout=5000)
    wait_for(page, server, "subscribe")
    assert page.evaluate("window.same")


def test_jog_does_not_survive_a_reconnection(opened: Opened) -> None:
    page, server = opened
    hold_jog(page, server)
    server.drop()
    expect(page.get_by_text("connected", exact=True)).to_be_visible(timeout=5000)
    page.wait_for_timeout(300)
    server.received.clear()
    server.send_token("t5")
    page.wait_for_timeout(SETTLE)
    assert server.of("beat") == []
    assert server.of("press") == []


def test_stalled_loop_is_shown(opened: Opened) -> None:
    page, server = opened
    server.state = "stalled"
    server.send_status()
    expect(page.get_by_text("no new cycles arrive")).to_be_visible()


def test_bars_show_limits_that_arrive_after_the_last_status(opened: Opened) -> None:
    page, _ = opened
    expect(page.get_by_role("meter", name="Position").first).to_have_attribute(
        "aria-valuemax", "2.9"
    )


def test_state_of_a_device_asks_first(opened: Opened) -> None:
    page, server = opened
    open_view(page, "devices/4")
    page.get_by_role("button", name="SAFE-OP", exact=True).click()
    page.get_by_role("button", name="Request SAFE-OP").click()
    page.wait_for_timeout(SETTLE)
    (call,) = [call for call in server.calls if call["method"] == "set_state"]
    assert call["params"] == {"position": 4, "state": "SAFE-OP", "force": True}


def test_viewer_cannot_command(browser: Browser) -> None:
    page = browser.new_page()
    server = FakeServer(page)
    server.role, server.reason_no_jog = "viewer", "this link is for viewers"
    open_view(page, "axes")
    for name in ("Enable all", "Jog joint_1 in positive", "Disable"):
        expect(page.get_by_role("button", name=name).first).to_be_disabled()
    expect(page.get_by_text("this link is for viewers")).to_be_visible()
    page.close()


def test_names_are_text(browser: Browser) -> None:
    page = browser.new_page()
    server = FakeServer(page)
    name = "<img src=x onerror=window.bad=1>\u202e</script>"
    server.axes = [name]
    devices = server.methods["devices"]
    server.methods["devices"] = lambda params: [
        {**device, "name": name}
        for device in devices(params)  # type: ignore[attr-defined]
    ]
    for view in ("axes", "devices", "overview"):
        open_view(page, view)
        expect(page.get_by_text(name).first).to_be_visible()
    assert page.evaluate("window.bad") is None
    page.close()


def test_wrong_token_is_refused_and_the_right_one_opens_the_page(browser: Browser) -> None:
    page = browser.new_page()
    FakeServer(page)
    page.goto(f"{ORIGIN}/#token=wrong")
    page.get_by_label("Token").fill("wrong")
    page.get_by_role("button", name="Connect").click()
    expect(page.get_by_text("refused this token")).to_be_visible()
    page.get_by_label("Token").fill("right")
    page.get_by_role("button", name="Connect").click()
    expect(page.get_by_text("connected", exact=True)).to_be_visible()
    page.close()


def test_token_disappears_from_the_address(browser: Browser) -> None:
    page = browser.new_page()
    FakeServer(page)
    page.goto(f"{ORIGIN}/#token=right")
    expect(page.get_by_text("connected", exact=True)).to_be_visible()
    assert "token" not in page.url
    page.close()


def test_object_is_written_with_its_type(opened: Opened) -> None:
    page, server = opened
    open_view(page, "devices/4")
    page.get_by_role("button", name="Objects").click()
    page.get_by_role("button", name="Edit 0x6065:00").click()
    field = page.get_by_role("textbox", name="0x6065:00")
    field.fill("-1")
    expect(page.get_by_text("out of range")).to_be_visible()
    expect(page.get_by_role("button", name="Write")).to_be_disabled()
    field.fill("0x10")
    page.get_by_role("button", name="Write").click()
    expect(page.get_by_text("Written: 0x6065:00")).to_be_visible()
    (write,) = [call for call in server.calls if call["method"] == "sdo_write"]
    assert write["params"] == {
        "position": 4,
        "index": 0x6065,
        "subindex": 0,
        "value": 16,
        "type": "UDINT",
    }


def test_search_loads_the_whole_dictionary(opened: Opened) -> None:
    page, _ = opened
    open_view(page, "devices/4")
    page.get_by_role("button", name="Objects").click()
    page.get_by_role("searchbox").fill("6130")
    expect(page.get_by_text("0x6130:00")).to_be_visible()
    expect(page.get_by_text("0x6001:00")).to_be_hidden()


@pytest.mark.parametrize("width", WIDTHS)
def test_views_fit_and_violate_no_policy(browser: Browser, width: int) -> None:
    context = browser.new_context(viewport={"width": width, "height": 844})
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    server = FakeServer(page)
    for view in VIEWS:
        open_view(page, view)
        server.send_timing()
        server.send_status()
        page.wait_for_timeout(100)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, view
        expect(page.get_by_role("button", name="Quick stop")).to_be_in_viewport(ratio=1)
        expect(page.get_by_text("Not an emergency stop")).to_be_in_viewport()
    assert complaints == []
    context.close()
