"""The program of `python -m catenary.operate`. It reports to its parent on stdout, line by line.

"note TEXT": an assumption or a warning. "ready": cycles run. "error TEXT": the reason of the end.
"""

from __future__ import annotations

import signal
import threading
import warnings
from contextlib import ExitStack
from dataclasses import replace

from catenary.errors import CatenaryError, ConfigurationError
from catenary.loop import Loop, StopPolicy
from catenary.machine import Machine
from catenary.machine.options import loop_options
from catenary.machine.read import read_machine
from catenary.operate.devices import make_requests
from catenary.remote.share import Share
from catenary.target import MainDevice, is_machine_file

CHECK_SECONDS = 0.2  # between two checks for an error of the loop


def main(target: str, name: str) -> int:
    """Operate a target until a signal or an error. Return the exit status.

    Args:
        target: name of a target, or a machine file.
        name: name of the share.
    """
    ended = threading.Event()
    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, lambda *_: ended.set())
    try:
        with warnings.catch_warnings(record=True) as caught, ExitStack() as stack:
            loop = open_loop(target, name, stack)
            for warning in caught:
                report("note", str(warning.message))
            loop.run_in_background()
            report("ready")
            while not ended.wait(CHECK_SECONDS):
                if loop.error is not None:
                    raise loop.error
    except (CatenaryError, ValueError, OSError) as error:
        message, hint = getattr(error, "message", str(error)), getattr(error, "hint", "")
        report("error", f"{message}; {hint}" if hint else message)
        return 1
    return 0


def open_loop(target: str, name: str, stack: ExitStack) -> Loop:
    """Open the loop of a target with its share.

    Args:
        target: name of a target, or a machine file.
        name: name of the share.
        stack: closes the loop, the share and the link.

    Raises:
        CatenaryError: the segment cannot be opened, or has no process data.
    """
    share = stack.enter_context(Share(name, jog=True))
    if is_machine_file(target):
        machine = stack.enter_context(Machine(target))
        stop = policy(loop_options(read_machine(target)).get("stop", StopPolicy()))
        loop = machine.loop(enable=False, sink=share, stop=stop, execution="threaded")
        return stack.enter_context(loop)
    main = stack.enter_context(MainDevice(target))
    requests, notes = make_requests(main.scan(strict=False))
    for note in notes:
        report("note", note)
    if not requests:
        raise ConfigurationError(f"no device on {target} has process data")
    return stack.enter_context(Loop(*requests, enable=False, sink=share, stop=policy(StopPolicy())))


def policy(given: StopPolicy) -> StopPolicy:
    """Return stop conditions under which a stopped or faulted axis does not end the loop."""
    return replace(given, on_axis_stopped="event", raise_faults=False)


def report(kind: str, text: str = "") -> None:
    """Print a line for the parent."""
    print(f"{kind} {' '.join(text.split())}".strip(), flush=True)
