"""Program of a machine with a share.

    python -m tests.browser.machine SHARE INTERFACE NAMES [modes]

NAMES is a JSON list with the names of the servos and axes. An empty INTERFACE is a segment in this
process. The commands "stall" and "resume" on the standard input stop and continue the body of the
loop, but not its cycle. With "modes", the program offers operating modes and presets: it accepts
all except the mode "balance".
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Sequence

import catenary as cat
from tests.browser.servos import COUNTS_PER_TURN, Monitor, answer_line, make_segment

PERIOD = 2e-3  # [s]
# The machine of the tests may be busy: continue after lost and late cycles.
POLICY = cat.StopPolicy(
    lost_limit=1000, late_limit=0.0, raise_faults=False, on_axis_stopped="event"
)
VELOCITY_LIMIT, ACCELERATION = 10.0, 20.0
WATCHDOG = 0.5  # [s]
MODES = {"damping": "hold softly", "stand": "hold the pose", "balance": "react to pushes"}
PRESETS = {"home": "arms down", "wave": "wave with the left arm"}
REFUSAL = "the robot does not stand: request 'stand' first"


class Body:
    """Body of the loop, which can stall."""

    def __init__(self) -> None:
        self._may_run = threading.Event()
        self._may_run.set()

    def stall(self) -> None:
        self._may_run.clear()

    def resume(self) -> None:
        self._may_run.set()

    def run(self, loop: cat.Loop, share: cat.Share) -> None:
        next(loop)
        answer_line("ready")
        for _ in loop:
            self._may_run.wait()
            for request in share.requests():
                decide(share, request)


def decide(share: cat.Share, request: cat.share.OperatorRequest) -> None:
    if request.name == "balance":
        request.refuse(REFUSAL)
    elif request.accept() and request.kind == "mode":
        share.mode = request.name


def main(share_name: str, interface: str, names: str, *options: str) -> None:
    segment = None if interface else make_segment(json.loads(names))
    body = Body()
    monitor = Monitor(segment if segment is not None else make_segment([]))
    monitor.answers["stall"] = lambda _: body.stall()
    monitor.answers["resume"] = lambda _: body.resume()
    monitor.start()
    with cat.MainDevice(interface if segment is None else segment) as main:
        share = cat.Share(share_name, jog=True, **offered(options))
        run(main, share, json.loads(names), body)


def offered(options: Sequence[str]) -> dict[str, dict[str, str]]:
    """Return the modes and presets of the program."""
    return {"modes": MODES, "presets": PRESETS} if "modes" in options else {}


def run(main: cat.MainDevice, share: cat.Share, names: list[str], body: Body) -> None:
    arm = cat.Drives(
        main.scan().drives,
        names=names,
        counts_per_turn=COUNTS_PER_TURN,
        velocity_limit=VELOCITY_LIMIT,
        acceleration_limit=ACCELERATION,
    )
    with (
        share,
        cat.Loop(arm, period=PERIOD, sink=share, stop=POLICY, watchdog=WATCHDOG) as loop,
    ):
        body.run(loop, share)


if __name__ == "__main__":
    arguments: Sequence[str] = sys.argv[1:]
    main(*arguments)
