"""Script time of the scope in the browser: 33 axes x 6 signals at 1 kHz, 32 traces on the screen.

    .venv/bin/python -m benchmarks.dashboard_scope [--seconds 20] [--throttle 4] [--out FILE]

Chromium runs the committed bundle under the page's content security policy, with the main thread
slowed down. The time of a frame is the time of its animation callbacks and of the messages since
the frame before. Lost samples are those that the page reports and gaps in the exported CSV.
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path
from typing import Any

from benchmarks.synthetic_dashboard import FIELDS, serving
from catenary.bench.report import machine

STATIC = Path(__file__).parents[1] / "src/catenary/dashboard/static"
BROWSER = "/usr/bin/chromium"
ARGUMENTS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]
MEASURE = """
(() => {
  const frames = (window.scriptTimes = []);
  let messages = 0;
  const timed = (callback, add) => (...args) => {
    const begin = performance.now();
    try { return callback(...args); } finally { add(performance.now() - begin); }
  };
  const request = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (callback) =>
    request(timed(callback, (spent) => { frames.push([spent, messages]); messages = 0; }));
  const setter = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
  Object.defineProperty(WebSocket.prototype, "onmessage", {
    ...setter,
    set(callback) { setter.set.call(this, timed(callback, (spent) => { messages += spent; })); },
  });
})();
"""


def layout(axes: int, traces: int = 32, charts: int = 4, window: int = 10) -> dict[str, Any]:
    """Return an arrangement of the scope that records every signal."""
    signals = [f"{field}[{axis}]" for field in FIELDS for axis in range(axes)]
    each = traces // charts
    shown = [signals[index * each : (index + 1) * each] for index in range(charts)]
    trigger = {"signal": "", "level": 0, "edge": "rising", "mode": "auto", "pre": 0.25, "window": 5}
    return {
        "charts": [{"id": index + 1, "traces": names} for index, names in enumerate(shown)],
        "recorded": signals,
        "window": window,
        "trigger": trigger,
        "triggerOn": False,
    }


def collect_errors(page: Any) -> list[str]:
    """Return a list that receives the errors of the page and the violations of its policy."""
    errors: list[str] = []

    def receive(entry: Any) -> None:
        if "Content Security" in entry.text:
            errors.append(entry.text)

    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", receive)
    return errors


def prepare(page: Any, axes: int, window: int) -> None:
    """Install the measurement and the arrangement before the page starts."""
    arrangement = json.dumps(json.dumps(layout(axes, window=window)))
    page.add_init_script(MEASURE)
    page.add_init_script(f"localStorage.setItem('catenary.scope.synthetic', {arrangement});")


def lost_rows(page: Any) -> int:
    """Export all samples as CSV, and return the number of missing rows."""
    page.locator(".scope-menu summary").click()
    page.locator(".scope-menu select").select_option("true")
    with page.expect_download() as download:
        page.get_by_role("button", name="CSV").click()
    with open(download.value.path(), newline="") as file:
        rows = list(csv.reader(file))[1:]
    cycles = [round(float(row[0]) * 1000) for row in rows]
    complete = [all(cell != "" for cell in row) for row in rows]
    return cycles[-1] - cycles[0] + 1 - sum(complete)


def quantiles(values: list[float]) -> dict[str, float]:
    """Return median, 95 and 99 percent quantile and maximum [ms]."""
    ordered = sorted(values)
    at = {"median": 0.5, "p95": 0.95, "p99": 0.99}
    figures = {name: round(ordered[int(q * (len(ordered) - 1))], 2) for name, q in at.items()}
    return figures | {"max": round(ordered[-1], 2)}


def script_seconds(session: Any) -> float:
    """Return the processor time of all scripts so far [s]."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return float(next(each["value"] for each in metrics if each["name"] == "ScriptDuration"))


def measure(seconds: float, throttle: float, axes: int, window: int) -> dict[str, Any]:
    """Run the scope in Chromium, and return the figures."""
    from playwright.sync_api import sync_playwright

    with serving(STATIC, axes) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        errors = collect_errors(page)
        prepare(page, axes, window)
        page.goto(f"{address}/#/scope")
        page.locator(".scope-chart").first.wait_for()
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        session.send("Emulation.setCPUThrottlingRate", {"rate": throttle})
        page.wait_for_timeout(2000 + 1000 * min(window, seconds))
        page.evaluate("scriptTimes.length = 0")
        before = script_seconds(session)
        page.wait_for_timeout(1000 * seconds)
        times = page.evaluate("scriptTimes")
        spent = script_seconds(session) - before
        session.send("Emulation.setCPUThrottlingRate", {"rate": 1})
        stored = page.locator(".scope-stored").inner_text()
        figures = {
            "axes": axes,
            "signals": axes * len(FIELDS),
            "traces": 32,
            "window_s": window,
            "throttle": throttle,
            "frames": len(times),
            "draw_ms": quantiles([draw for draw, _ in times]),
            "messages_ms": quantiles([messages for _, messages in times]),
            "frame_ms": quantiles([sum(each) for each in times]),
            "cpu_per_frame_ms": round(1000 * spent / len(times), 2),
            "stored": stored,
            "lost_rows": lost_rows(page),
            "errors": errors,
        }
        browser.close()
    return figures


def main() -> None:
    """Print the figures, and write them to a file."""
    parser = argparse.ArgumentParser(description="Measure the script time of the scope.")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--throttle", type=float, default=4.0)
    parser.add_argument("--axes", type=int, default=33)
    parser.add_argument("--window", type=int, default=10, help="visible seconds")
    parser.add_argument("--out", type=Path, help="file for the figures (JSON)")
    options = parser.parse_args()
    figures = measure(options.seconds, options.throttle, options.axes, options.window)
    text = json.dumps({"machine": machine(), **figures}, indent=2, ensure_ascii=False)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
