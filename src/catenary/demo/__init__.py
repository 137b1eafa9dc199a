"""Demo: three virtual drives follow a sine at 1 kHz, with real EtherCAT frames."""

from __future__ import annotations

from pathlib import Path


def run_demo(seconds: float, folder: Path, *, in_process: bool = False) -> None:
    """Run the demo, print its results, and write `demo.json` and `demo.html`.

    Unless `in_process`, this may restart the program in its own network namespace. Do not import
    modules that start threads (NumPy) before this call.

    Args:
        seconds: Duration of the motion [s].
        folder: Folder of the two files; it is created if necessary.
        in_process: True to run the segment in this process, without a network.
    """
    from catenary.realtime import private_network

    refused = "--in-process" if in_process else None
    if not in_process:
        state = private_network.enter()
        if isinstance(state, private_network.Refused):
            refused = state.reason

    from catenary.demo.show import show

    show(seconds, folder, refused=refused)
