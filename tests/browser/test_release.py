"""Every end of a touch or a key stops a jog at once: by a release, not by the expiry of a token."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.browser.pages import SECONDS, Operator, expect
from tests.browser.rig import NAMES, PRESSES, Rig
from tests.share.processes import comes_true

AXIS = NAMES[0]
Action = Callable[[], object]
CAUSES = {
    "pointercancel": """button => button.dispatchEvent(
        new PointerEvent("pointercancel", {pointerId: 1, bubbles: true}))""",
    "lostpointercapture": "button => button.releasePointerCapture(1)",
    "blur": 'button => window.dispatchEvent(new Event("blur"))',
    "pagehide": 'button => window.dispatchEvent(new PageTransitionEvent("pagehide"))',
    "visibilitychange": """button => {
        Object.defineProperty(document, "hidden", {get: () => true, configurable: true});
        document.dispatchEvent(new Event("visibilitychange"));
        delete document.hidden;
    }""",
}


def assert_released(rig: Rig, shown: Operator) -> None:
    expect(shown.answer(AXIS)).to_have_text("released", timeout=SECONDS)
    assert rig.stands()
    assert rig.state()["state"] == "OPERATION ENABLED"


def assert_releases(rig: Rig, shown: Operator, begin: Action, end: Action) -> None:
    """Assert that `end` releases the jog of `begin`.

    On a busy machine, a jog may expire before `end`, or be refused. Then both are repeated.
    """
    for _ in range(PRESSES):
        begin()
        expect(shown.answer(AXIS)).not_to_be_empty(timeout=SECONDS)
        end()
        assert comes_true(lambda: shown.has_ended(AXIS))
        shown.page.mouse.up()
        shown.page.keyboard.up("ArrowRight")
        if shown.answer(AXIS).text_content() == "released":
            break
    assert_released(rig, shown)


def test_release_of_the_button(shared_rig: Rig) -> None:
    with shared_rig.operating() as shown:
        assert_releases(shared_rig, shown, lambda: shown.press(AXIS), shown.page.mouse.up)


@pytest.mark.parametrize("cause", CAUSES)
def test_loss_of_the_pointer_or_the_page(shared_rig: Rig, cause: str) -> None:
    """The mouse button stays pressed, and the jog does not continue."""
    with shared_rig.operating() as shown:

        def begin() -> None:
            assert shared_rig.jogs(shown)

        def end() -> None:
            shown.plus(AXIS).evaluate(CAUSES[cause])
            shown.page.mouse.move(1, 1)  # Chromium reports a lost capture with the next event

        assert_releases(shared_rig, shown, begin, end)


@pytest.mark.parametrize("end", ["key", "focus"])
def test_release_of_the_key(shared_rig: Rig, end: str) -> None:
    """The key is released, or the control loses the focus while the key is pressed."""
    with shared_rig.operating() as shown:
        control, keyboard = shown.axis(AXIS).locator(".jog"), shown.page.keyboard

        def begin() -> None:
            control.focus()
            keyboard.down("ArrowRight")

        def release() -> None:
            if end == "key":
                keyboard.up("ArrowRight")
            else:
                control.evaluate("each => each.blur()")

        assert_releases(shared_rig, shown, begin, release)


def test_another_view(shared_rig: Rig) -> None:
    """The page leaves the view, for example by the back button, while the mouse is pressed."""
    with shared_rig.operating() as shown:
        assert shared_rig.jogs(shown)
        shown.page.evaluate('location.hash = "#/overview"')
        assert shared_rig.stands()
        shown.page.mouse.up()


def test_a_step_ends_by_itself(shared_rig: Rig) -> None:
    from math import radians

    with shared_rig.operating() as shown:
        before = float(shared_rig.state()["position"])  # type: ignore[arg-type]
        shown.page.get_by_role("button", name="1°", exact=True).click()
        shown.press(AXIS)
        expect(shown.answer(AXIS)).to_have_text("the motion is complete", timeout=SECONDS)
        assert shared_rig.stands()
        after = float(shared_rig.state()["position"])  # type: ignore[arg-type]
        assert after - before == pytest.approx(radians(1), abs=1e-3)
        shown.page.mouse.up()


def test_a_phone_needs_two_touches(shared_rig: Rig) -> None:
    """One touch is refused. The end of the enabling touch stops the jog."""

    with shared_rig.operating(width=390, touch=True) as shown:
        pad = shown.page.get_by_role("button", name="HOLD TO ENABLE")
        shown.plus(AXIS).scroll_into_view_if_needed()
        touches = shown.page.context.new_cdp_session(shown.page)
        places = []
        for number, each in enumerate((pad, shown.plus(AXIS))):
            box = each.bounding_box()
            assert box is not None
            x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            places.append({"x": x, "y": y, "id": number})

        def touch(kind: str, *points: dict[str, float]) -> None:
            event = {"type": kind, "touchPoints": list(points)}
            touches.send("Input.dispatchTouchEvent", event)

        touch("touchStart", places[1])
        expect(shown.answer(AXIS)).to_contain_text("another finger", timeout=SECONDS)
        touch("touchEnd")
        touch("touchStart", places[0])
        touch("touchStart", *places)
        assert shared_rig.moves()
        touch("touchEnd", places[1])
        assert_released(shared_rig, shown)
        touch("touchEnd")
