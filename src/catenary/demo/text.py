"""Text of the demo: devices, a progress bar, the results."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TextIO

from catenary.demo.result import Device, Result

BAR = 40  # characters
REDRAW_SECONDS = 0.1


def device_lines(devices: Sequence[Device]) -> str:
    width = max((len(device.name) for device in devices), default=0)
    return "\n".join(
        f"  {d.position:3d}  {d.name:{width}}  0x{d.vendor:08X}:0x{d.product:08X}  {d.state}"
        for d in devices
    )


def closing_lines(result: Result) -> str:
    error = result.tracking_error
    return (
        f"  tracking error {error['rms'] * 1e3:.2f} mrad rms, {error['max'] * 1e3:.2f} mrad max, "
        "against the set-point that had reached the drive\n"
        f"  transport delay {result.transport_delay * 1e3:g} ms, from writing a set-point to "
        f"reading the first position that it affects{longer(result)}\n"
        f"  scheduling {result.scheduling}; link {result.link}"
    )


def longer(result: Result) -> str:
    """Return a note on cycles without fresh set-points; empty if there were none."""
    late = result.timing.counters.get("uncommitted", 0)
    return f"; longer in {late} uncommitted cycles" if late else ""


class ProgressBar:
    """Progress bar in the last line of a terminal. It prints nothing to other streams."""

    def __init__(self, seconds: float, stream: TextIO | None = None) -> None:
        self._seconds = seconds
        self._stream = stream or sys.stdout
        self._next = 0.0 if self._stream.isatty() else float("inf")

    def show(self, elapsed: float) -> None:
        """Update the bar if `REDRAW_SECONDS` have passed, so that every cycle may call this."""
        if elapsed < self._next:
            return
        self._next = elapsed + REDRAW_SECONDS
        part = min(elapsed / self._seconds, 1.0)
        done = round(part * BAR)
        self._stream.write(
            f"\r  {'█' * done}{'░' * (BAR - done)} {min(elapsed, self._seconds):4.1f} s"
        )
        self._stream.flush()

    def clear(self) -> None:
        if self._next != float("inf"):
            self._stream.write("\r\x1b[K")
            self._stream.flush()
