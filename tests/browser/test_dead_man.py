"""Failures while a jog button is held. The servo itself must come to a standstill and stay there.

The tokens stop the axis 200 ms after the last one that the page has echoed, whatever has failed.
Nothing that arrives later moves the axis again: this needs a new press.
"""

from __future__ import annotations

import json
import signal
import subprocess
import time
from contextlib import ExitStack

from tests.browser import processes
from tests.browser.chromium import Chromium
from tests.browser.pages import SECONDS, expect, operator
from tests.browser.raw_client import RawClient
from tests.browser.rig import NAMES, Rig
from tests.share.processes import comes_true

AXIS = NAMES[0]
SPEED = 1.0  # [rad/s]
BURST = 100  # heartbeats


def assert_stays(rig: Rig, position: float) -> None:
    """Assert that the servo has not moved since `position`, at standstill."""
    assert rig.stands()
    assert abs(rig.position() - position) < 1e-3


# The browser


def test_browser_stopped_and_continued(shared_rig: Rig, own_browser: Chromium) -> None:
    with operator(own_browser.browser, shared_rig.dashboard) as shown:
        shown.open("Axes").require_enabled(AXIS)
        assert shared_rig.jogs(shown)
        own_browser.signal(signal.SIGSTOP)
        assert shared_rig.stands()
        assert shared_rig.state()["state"] == "OPERATION ENABLED"
        position = shared_rig.position()
        own_browser.signal(signal.SIGCONT)
        expect(shown.plus(AXIS)).to_have_attribute("aria-pressed", "false", timeout=SECONDS)
        assert_stays(shared_rig, position)
        shown.page.mouse.up()


def test_browser_killed(shared_rig: Rig, own_browser: Chromium) -> None:
    with operator(own_browser.browser, shared_rig.dashboard) as shown:
        shown.open("Axes").require_enabled(AXIS)
        assert shared_rig.jogs(shown)
        own_browser.end()
        assert shared_rig.stands()
    with shared_rig.operating() as other:  # the lease of the dead browser has ended
        assert shared_rig.jogs(other)
        other.page.mouse.up()
        assert shared_rig.stands()


def test_page_frozen(shared_rig: Rig) -> None:
    with shared_rig.operating() as shown:
        assert shared_rig.jogs(shown)
        life = shown.page.context.new_cdp_session(shown.page)
        life.send("Page.setWebLifecycleState", {"state": "frozen"})
        life.send("Debugger.enable")  # Chromium freezes no visible page, so this stops its scripts
        paused: list[object] = []
        life.on("Debugger.paused", lambda event: paused.append(event))
        life.send("Debugger.pause")
        assert shared_rig.stands()
        position = shared_rig.position()
        until = time.monotonic() + SECONDS / 1e3
        while not paused and time.monotonic() < until:
            shown.page.wait_for_timeout(20)  # Playwright receives events only while it waits
        life.send("Debugger.resume")
        life.send("Page.setWebLifecycleState", {"state": "active"})
        expect(shown.plus(AXIS)).to_have_attribute("aria-pressed", "false", timeout=SECONDS)
        assert_stays(shared_rig, position)
        shown.page.mouse.up()


def test_page_blocked_by_its_own_script(shared_rig: Rig) -> None:
    with shared_rig.operating() as shown:
        assert shared_rig.jogs(shown)
        shown.page.evaluate(
            "setTimeout(() => { for (const t = Date.now(); Date.now() < t + 2000;); })"
        )
        assert shared_rig.stands()
        position = shared_rig.position()
        expect(shown.plus(AXIS)).to_have_attribute("aria-pressed", "false", timeout=SECONDS)
        assert_stays(shared_rig, position)
        shown.page.mouse.up()


def test_clock_of_the_page_jumps(shared_rig: Rig) -> None:
    """A jump forward by an hour ends the jog, because the page then holds an old token."""
    with shared_rig.open() as shown:
        shown.page.clock.install()
        shown.open("Axes").require_enabled(AXIS)
        shown.page.clock.set_system_time("1990-01-01")
        assert shared_rig.jogs(shown)
        shown.page.clock.fast_forward("01:00:00")
        assert shared_rig.stands()
        shown.page.mouse.up()


# The server


def test_server_stopped_and_continued(local: Rig) -> None:
    """The heartbeats of the browser wait in the server's socket. Their burst moves nothing."""
    with local.operating() as shown:
        assert local.jogs(shown)
        local.dashboard.process.signal(signal.SIGSTOP)
        assert local.stands()
        position = local.position()
        local.dashboard.process.signal(signal.SIGCONT)
        expect(shown.answer(AXIS)).to_contain_text("heartbeat", timeout=SECONDS)
        assert_stays(local, position)
        shown.page.mouse.up()


def test_server_killed_and_started_again(local: Rig) -> None:
    """The page works again without reloading. The new server does not continue the jog."""
    with local.operating() as shown, ExitStack() as stack:
        shown.page.evaluate("window.loadedOnce = true")
        assert local.jogs(shown)
        local.dashboard.process.signal(signal.SIGKILL)
        assert local.stands()
        position = local.position()
        expect(shown.page.get_by_role("alert").first).to_contain_text("server", timeout=SECONDS)
        stack.enter_context(processes.dashboard(local.share, port=local.dashboard.port))
        expect(shown.page.get_by_role("status").first).to_have_text("connected", timeout=SECONDS)
        assert_stays(local, position)
        shown.page.mouse.up()
        assert local.jogs(shown)
        shown.page.mouse.up()
        assert local.stands()
        assert shown.page.evaluate("window.loadedOnce")


# The program of the loop


def test_body_of_the_loop_stalls(local: Rig) -> None:
    """The core judges jogs: Python of the loop's program is not needed to stop."""
    with local.operating() as shown:
        assert local.jogs(shown)
        local.loop.ask("stall")
        shown.page.mouse.up()
        assert local.stands()
        assert local.jogs(shown)
        local.dashboard.process.signal(signal.SIGSTOP)
        assert local.stands()
        local.dashboard.process.signal(signal.SIGCONT)
        shown.page.mouse.up()
        shown.page.keyboard.press("Escape")
        assert local.becomes("SWITCH ON DISABLED")
        local.loop.ask("resume")


def test_loop_stopped(wired: Rig) -> None:
    """The watchdog of the drive stops the axis. The page reports that no cycles arrive."""
    with wired.operating() as shown:
        assert wired.jogs(shown)
        wired.loop.signal(signal.SIGSTOP)
        assert wired.stands()
        assert wired.loses_power()
        expect(shown.page.get_by_role("alert").first).to_contain_text("no new", timeout=SECONDS)
        wired.loop.signal(signal.SIGCONT)
        assert wired.stands()
        shown.page.mouse.up()


def test_loop_killed(wired: Rig) -> None:
    with wired.operating() as shown:
        assert wired.jogs(shown)
        wired.loop.signal(signal.SIGKILL)
        assert wired.stands()
        assert wired.loses_power()
        expect(shown.page.get_by_role("alert").first).to_contain_text("share", timeout=SECONDS)
        shown.page.mouse.up()


def test_link_down(wired: Rig) -> None:
    """The watchdog of the drive stops the axis; after the return of the link it does not move."""
    with wired.operating() as shown:
        assert wired.jogs(shown)
        subprocess.run(["ip", "link", "set", wired.interface, "down"], check=True)
        assert wired.stands()
        assert wired.loses_power()
        position = wired.position()
        subprocess.run(["ip", "link", "set", wired.interface, "up"], check=True)
        shown.page.mouse.up()
        assert_stays(wired, position)


# Messages that no page would send


def test_burst_of_old_heartbeats(shared_rig: Rig) -> None:
    with shared_rig.operating(), RawClient(shared_rig.dashboard) as client:
        tokens = [client.until("token")["token"] for _ in range(3)]
        press, _ = client.press(SPEED)
        client.until("jog", press=press, status="EXPIRED")
        assert shared_rig.stands()
        position = shared_rig.position()
        for number in range(BURST):
            client.send(op="beat", axis=0, press=press, token=tokens[number % 3])
        client.send(op="beat", axis=0, press=press, token=client.until("token")["token"])
        client.send(op="ping", t=1.0)
        client.until("pong")
        assert_stays(shared_rig, position)


def test_press_with_an_old_token(shared_rig: Rig) -> None:
    with shared_rig.operating(), RawClient(shared_rig.dashboard) as client:
        position = shared_rig.position()
        old = client.until("token")["token"]
        for _ in range(10):
            client.until("token")
        client.send(op="press", axis=0, velocity=SPEED, distance=None, token=old, press=1)
        assert client.until("jog", press=1)["status"] == "REFUSED_STALE"
        assert_stays(shared_rig, position)


def test_invented_tokens(shared_rig: Rig) -> None:
    """Heartbeats with numbers that the core has not issued do not extend a jog."""
    with shared_rig.operating(), RawClient(shared_rig.dashboard) as client:
        press, token = client.press(SPEED)
        for offset in range(1, BURST):
            guess = str((int(token) + offset) % (1 << 48))
            client.send(op="beat", axis=0, press=press, token=guess)
        client.until("jog", press=press, status="EXPIRED")
        assert shared_rig.stands()


def test_flood_of_messages(local: Rig) -> None:
    """A hostile client is disconnected. The operator stays connected, and can stop and move."""
    from websockets.exceptions import ConnectionClosed

    with local.operating() as shown, RawClient(local.dashboard) as hostile:
        assert local.jogs(shown)
        message, closed = json.dumps({"op": "ping", "t": 0.0}), False
        for _ in range(10_000):
            try:
                hostile.socket.send(message)
            except ConnectionClosed:
                closed = True
                break
        assert closed or comes_true(lambda: hostile.socket.close_code is not None)
        assert hostile.socket.close_code == 1008
        shown.page.mouse.up()
        assert local.stands()
        assert local.jogs(shown)
        shown.page.mouse.up()
        assert local.stands()


def test_two_operators(shared_rig: Rig, own_browser: Chromium) -> None:
    """The second one is refused with the reason, and its release does not stop the first one."""
    with (
        shared_rig.operating() as first,
        operator(own_browser.browser, shared_rig.dashboard) as second,
    ):
        second.open("Axes")
        assert shared_rig.jogs(first)
        second.press(AXIS)
        expect(second.answer(AXIS)).to_contain_text("lease", timeout=SECONDS)
        second.page.mouse.up()
        assert shared_rig.moves()
        assert "mov" in (first.answer(AXIS).text_content() or "")
        first.page.mouse.up()
        assert shared_rig.stands()
        assert shared_rig.jogs(second)
        second.page.mouse.up()
        assert shared_rig.stands()
