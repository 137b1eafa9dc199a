"""The demo: three virtual drives follow a sine at 1 kHz over real EtherCAT frames."""

from __future__ import annotations

from pathlib import Path


def run_demo(seconds: float, folder: Path, *, in_process: bool = False) -> None:
    """Runs, prints, and writes `demo.json` and `demo.html` into `folder`.

    Unless `in_process`, it may first run this program anew in a network namespace of its own:
    nothing with threads (NumPy) may be imported before that.
    """
    from catenary.realtime import private_network

    refused = "asked for" if in_process else None
    if not in_process:
        state = private_network.enter()
        if isinstance(state, private_network.Refused):
            refused = state.reason

    from catenary.demo.show import show

    show(seconds, folder, refused=refused)
