"""Delays of the operator's page: `python -m benchmarks.dashboard_times --presses 50 --json FILE`.

- First paint: from the navigation to the first contentful paint, in a new browser context.
- Stop by keyboard: from just before the key is sent to the browser until the controlword of the
  virtual servo requests a quick stop. It contains the way through the debugger of the browser.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.realtime.private_network import enter

if TYPE_CHECKING:
    from tests.browser.rig import Rig

PAINT_LIMIT, STOP_LIMIT = 1.0, 0.050  # [s]
PAINTS = 10
FIRST_PAINT = """() => new Promise((resolve) => new PerformanceObserver((list) =>
  list.getEntriesByName("first-contentful-paint").forEach((entry) => resolve(entry.startTime)))
  .observe({type: "paint", buffered: true}))"""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presses", type=int, default=50)
    parser.add_argument("--json", type=Path, help="file for the results")
    chosen = parser.parse_args(arguments)
    enter()
    paints, stops = measure(chosen.presses)
    print(f"{machine()}\n")
    print(line("first paint", paints, PAINT_LIMIT))
    print(line("stop by keyboard", stops, STOP_LIMIT))
    figures = {"first_paint_s": paints, "keyboard_stop_s": stops}
    write(chosen.json, {"machine": machine(), **figures})


def measure(presses: int) -> tuple[list[float], list[float]]:
    """Return the times of first paints, and of stops by keyboard [s]."""
    from playwright.sync_api import sync_playwright

    from tests.browser.chromium import started
    from tests.browser.rig import local_rig

    command = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if command is None:
        raise SystemExit("Chromium is not installed (package chromium)")
    with ExitStack() as stack:
        playwright = stack.enter_context(sync_playwright())
        browser = stack.enter_context(started(playwright, command)).browser
        rig = local_rig(stack, browser)
        return [first_paint(rig) for _ in range(PAINTS)], keyboard_stops(rig, presses)


def first_paint(rig: Rig) -> float:
    """Return the time from the navigation to the first contentful paint [s]."""
    with rig.open() as shown:
        shown.open()
        milliseconds: float = shown.page.evaluate(FIRST_PAINT)
        return round(milliseconds * 1e-3, 4)


def keyboard_stops(rig: Rig, presses: int) -> list[float]:
    """Return the times from Escape to the quick stop at the servo [s]."""
    from tests.browser.pages import SECONDS, expect

    found = []
    with rig.operating() as shown:
        for _ in range(presses):
            shown.require_enabled("shoulder")
            if not rig.becomes("OPERATION ENABLED"):
                raise RuntimeError("the servo was not enabled")
            rig.servos.tell("stop_time")
            start = time.monotonic()
            shown.page.keyboard.press("Escape")
            found.append(round(float(rig.servos.line()) - start, 5))
            if not rig.becomes("SWITCH ON DISABLED"):
                raise RuntimeError("the servo did not stop")
            expect(shown.plus("shoulder")).to_be_disabled(timeout=SECONDS)  # the page shows it
    return found


def line(name: str, times: Sequence[float], limit: float) -> str:
    """Return the median and the maximum, compared with a limit for the maximum."""
    median, largest = statistics.median(times), max(times)
    verdict = "reached" if largest <= limit else "NOT REACHED"
    return (
        f"{name}: median {median * 1e3:.1f} ms, maximum {largest * 1e3:.1f} ms of {len(times)}, "
        f"limit {limit * 1e3:g} ms: {verdict}"
    )


if __name__ == "__main__":
    main()
