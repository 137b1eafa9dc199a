"""A machine with servos and its page, as the tests use them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from tests.browser import processes
from tests.browser.processes import Dashboard, Process
from tests.share.names import own_name
from tests.share.processes import comes_true

if TYPE_CHECKING:
    from playwright.sync_api import Browser

    from tests.browser.pages import Operator

STANDSTILL, MOTION = 1e-2, 5e-2  # [rad/s]
NAMES = ("shoulder", "elbow")
PRESSES = 20

Opener = Callable[..., AbstractContextManager["Operator"]]


@dataclass
class Rig:
    """A machine with servos, its page, and the servos' own state."""

    share: str
    loop: Process
    servos: Process  # the process that contains the servos
    dashboard: Dashboard
    open: Opener
    interface: str = ""  # of the loop

    def state(self, axis: int = 0) -> dict[str, Any]:
        """Return the state of a servo itself."""
        return self.servos.ask("state")[axis]  # type: ignore[no-any-return]

    def velocity(self, axis: int = 0) -> float:
        return abs(float(self.state(axis)["velocity"]))

    def position(self, axis: int = 0) -> float:
        return float(self.state(axis)["position"])

    def becomes(self, state: str, axis: int = 0) -> bool:
        """Wait until a servo has a state of CiA 402. Return False if it does not reach it."""
        return comes_true(lambda: self.state(axis)["state"] == state)

    def loses_power(self, axis: int = 0) -> bool:
        """Wait until a servo leaves OPERATION ENABLED. Return False if it does not."""
        return comes_true(lambda: self.state(axis)["state"] != "OPERATION ENABLED")

    def jogs(self, shown: Operator, axis: int = 0) -> bool:
        """Hold the jog button of an axis until its servo moves. Return False if it does not.

        A busy machine may deliver tokens too late. The jog is then refused or ends, and the button
        is pressed again.
        """
        name = NAMES[axis]
        for _ in range(PRESSES):
            shown.press(name)
            comes_true(lambda: self.velocity(axis) > MOTION or shown.has_ended(name))
            if self.velocity(axis) > MOTION:
                return True
            shown.page.mouse.up()
        return False

    def moves(self, axis: int = 0) -> bool:
        """Wait until a servo moves. Return False if it does not."""
        return comes_true(lambda: self.velocity(axis) > MOTION)

    @contextmanager
    def operating(self, axis: str = NAMES[0], **options: object) -> Iterator[Operator]:
        """Open the axes of the page, with this axis enabled."""
        with self.open(**options) as shown:
            shown.open("Axes").require_enabled(axis)
            yield shown

    def stands(self, axis: int = 0) -> bool:
        """Wait until a servo stands still. Return False if it does not."""
        return comes_true(lambda: self.velocity(axis) < STANDSTILL)


def local_rig(
    stack: ExitStack, browser: Browser, names: tuple[str, ...] = NAMES, *, modes: bool = False
) -> Rig:
    """Start a machine whose servos are in the process of its loop.

    Args:
        stack: owner of the processes.
        browser: browser of the pages.
        names: names of the axes.
        modes: True if the program offers operating modes and presets.
    """
    share = stack.enter_context(own_name("browser"))
    options = ("modes",) if modes else ()
    loop = stack.enter_context(processes.machine(share, names, "", *options))
    dashboard = stack.enter_context(processes.dashboard(share))
    return Rig(share, loop, loop, dashboard, opener(browser, dashboard))


def wired_rig(stack: ExitStack, browser: Browser, near: str, far: str) -> Rig:
    """Start a machine whose servos are in another process, at the other end of a wire."""
    share = stack.enter_context(own_name("browser"))
    servos = stack.enter_context(processes.servos_on(far, NAMES))
    loop = stack.enter_context(processes.machine(share, NAMES, near))
    dashboard = stack.enter_context(processes.dashboard(share))
    return Rig(share, loop, servos, dashboard, opener(browser, dashboard), near)


def opener(browser: Browser, dashboard: Dashboard) -> Opener:
    """Return a function that opens the page of a dashboard."""
    from tests.browser.pages import operator

    return partial(operator, browser, dashboard)
