"""Complete run of the demo, with its output."""

from __future__ import annotations

import textwrap
from pathlib import Path

import catenary as cat
from catenary.demo.ground import ground
from catenary.demo.motion import (
    LATE_LIMIT,
    LOST_LIMIT,
    PERIOD,
    WATCHDOG,
    Recording,
    drives_of,
    follow,
)
from catenary.demo.page import as_html
from catenary.demo.result import PHASES, Device, Result, as_json
from catenary.demo.text import ProgressBar, closing_lines, device_lines


def show(seconds: float, folder: Path, *, refused: str | None) -> None:
    """Run the demo, print its results and write its files.

    Args:
        seconds: Duration of the motion [s].
        folder: Folder of `demo.json` and `demo.html`.
        refused: Reason for a run without real frames; None for a run with real frames.
    """
    folder.mkdir(parents=True, exist_ok=True)
    result = run(seconds, refused=refused)
    print(textwrap.indent(str(result.timing), "  "))
    print(closing_lines(result))
    (folder / "demo.json").write_text(as_json(result) + "\n")
    (folder / "demo.html").write_text(as_html(result))
    print(f"wrote {folder / 'demo.json'} and {folder / 'demo.html'}")


def run(seconds: float, *, refused: str | None) -> Result:
    with ground(refused) as here, cat.MainDevice(here.source) as main:
        if refused is not None:
            print(f"no real frames ({refused}): the segment runs in this process")
        arm = drives_of(main.scan())
        recording = Recording(seconds, len(arm))
        progress = ProgressBar(seconds)
        with cat.Loop(
            arm,
            period=PERIOD,
            stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
            watchdog=WATCHDOG,
        ) as loop:
            devices = [device(sub) for sub in main.subs]
            print(device_lines(devices))
            follow(loop, arm, recording, progress)
            progress.clear()
        return Result(
            devices=devices,
            period=PERIOD,
            cycles=len(recording),
            timing=loop.timing,
            histograms={phase: loop.histogram(phase) for phase in (*PHASES, "round_trip")},
            motion=recording.motion(),
            link=here.link,
            scheduling=loop.scheduling,
        )


def device(sub: cat.SubDevice) -> Device:
    identity = sub.identity
    return Device(sub.position, sub.name, identity.vendor, identity.product, str(sub.state))
