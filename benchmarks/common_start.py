"""`python -m benchmarks.common_start`: start of two arms that get one trajectory with a start time.

The arms are those of examples/two_machines: each has a network namespace, a loop at 500 Hz with
virtual drives, and a bridge to ROS 2. A third node publishes to both. The start is the first cycle
with another commanded position. The arms have one clock, so the figures contain no error of PTP.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import catenary as cat
from benchmarks.needed import need
from catenary.bench.report import machine
from catenary.errors import CatenaryError
from catenary.realtime import private_network
from catenary.ros2 import messages
from catenary.ros2.backend import COMMAND, Backend, Publisher, open_backend
from catenary.share import Reader

ROBOT = Path(__file__).resolve().parents[1] / "examples" / "two_machines" / "robot.py"
SIDES = ("left", "right")
TURN, DURATION, DELAY = 0.1, 0.4, 0.5  # [rad], [s], [s] until the start
STARTED = 1e-6  # [rad]; less than one step of a set-point
TIMEOUT = 60.0  # [s]


@dataclass
class Arm:
    """One arm: its share, and the publisher of its trajectories."""

    share: Reader
    trajectory: Publisher

    def turn(self, angle: float, start_ns: int) -> None:
        """Publish a trajectory of all joints.

        Args:
            angle: angle of the turn [rad].
            start_ns: time of the start [ns, UTC].
        """
        goal = [float(p) + angle for p in self.share.read()["commanded_position"]]
        duration = messages.Duration.from_seconds(DURATION)
        point = messages.JointTrajectoryPoint(goal, time_from_start=duration)
        header = messages.Header(messages.Time.from_ns(start_ns))
        names = list(self.share.layout.axes)
        self.trajectory.publish(messages.JointTrajectory(header, names, [point]))

    def start_ns(self, after: int) -> int | None:
        """Return the time of the first cycle that moves [ns, UTC]; None if none does.

        Args:
            after: number of a cycle before the motion.
        """
        rows, _ = self.share.rows(after=after)
        moved = np.abs(np.diff(rows["commanded_position"], axis=0)) > STARTED
        first = np.flatnonzero(moved.any(axis=1))
        if not len(first):
            return None
        return int(rows["scheduled_ns"][first[0] + 1]) + self.share.layout.utc_offset_ns


@contextmanager
def arms(node: Callable[[], Backend]) -> Iterator[tuple[Backend, list[Arm]]]:
    """Run both robots and a node, each in a network namespace.

    Args:
        node: opens the node in the namespace of the caller.
    """
    from tests.machines.namespaces import SWITCH, connected_machines

    with connected_machines(len(SIDES)) as found, ExitStack() as stack:
        private_network.run_ip("address", "add", "10.77.0.100/24", "dev", SWITCH)
        names = {side: f"bench-{side}-{os.getpid()}" for side in SIDES}
        for each, (side, name) in zip(found, names.items(), strict=True):
            options = ("arm", "--name", name, "--namespace", side)
            process = each.start(str(ROBOT), *options)
            stack.callback(process.wait)
            stack.callback(process.send_signal, signal.SIGINT)
        backend = node()
        stack.callback(backend.close)
        kind = messages.JointTrajectory
        topics = {s: backend.publisher(f"/{s}/joint_trajectory", kind, COMMAND) for s in SIDES}
        until(backend, lambda: all(each.matched for each in topics.values()), "the arms")
        shares = {s: stack.enter_context(cat.attach(names[s])) for s in SIDES}
        yield backend, [Arm(shares[side], topics[side]) for side in SIDES]


def until(node: Backend, condition: Callable[[], object], what: str) -> None:
    """Run the node until the condition holds.

    Args:
        node: the node.
        condition: true at the end.
        what: awaited object, for the error.
    """
    end = time.monotonic() + TIMEOUT
    while not condition():
        if time.monotonic() > end:
            raise CatenaryError(f"timeout after {TIMEOUT:.0f} s: {what}")
        node.spin_once(0.05)


def measure(count: int) -> dict[str, Any]:
    """Return the figures of `count` common trajectories."""
    with arms(lambda: open_backend("common_start", kind="cyclone")) as (node, pair):
        move_once(node, pair, TURN)  # not measured: both drives are enabled after it
        delays = np.array([move(node, pair, TURN * (-1) ** (n + 1)) for n in range(count)]) * 1e-6
    return {
        "machine": machine(),
        "load_average": os.getloadavg()[0],
        "trajectories": count,
        "period_ms": 2.0,
        "start_after_stamp_ms": figures(delays.ravel()),
        "difference_ms": figures(np.abs(delays[:, 0] - delays[:, 1])),
    }


def move_once(node: Backend, pair: Sequence[Arm], angle: float) -> None:
    """Repeat a trajectory that starts at once, until both arms have moved.

    Args:
        node: the node.
        pair: both arms.
        angle: angle of the turn [rad].
    """
    for arm in pair:
        begin = arm.share.read()["number"]

        def moves(arm: Arm = arm, begin: int = int(begin)) -> bool:
            arm.turn(angle, 0)
            return arm.start_ns(begin) is not None

        until(node, moves, "an arm does not move")
    pause(node, 2 * DURATION)


def move(node: Backend, pair: Sequence[Arm], angle: float) -> list[int]:
    """Return the time from the stamp to the start of each arm [ns].

    Args:
        node: the node.
        pair: both arms.
        angle: angle of the turn [rad].
    """
    begins = [int(arm.share.read()["number"]) for arm in pair]
    start_ns = time.time_ns() + round(DELAY * 1e9)
    for arm in pair:
        arm.turn(angle, start_ns)
    pause(node, DELAY + DURATION + 0.2)
    starts = [arm.start_ns(begin) for arm, begin in zip(pair, begins, strict=True)]
    if None in starts:
        raise CatenaryError("an arm has not moved")
    return [start - start_ns for start in starts if start is not None]


def pause(node: Backend, seconds: float) -> None:
    end = time.monotonic() + seconds
    until(node, lambda: time.monotonic() > end, "the end of a motion")


def figures(values: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, float]:
    """Return minimum, median and maximum."""
    low, middle, high = (round(float(np.percentile(values, q)), 2) for q in (0, 50, 100))
    return {"min": low, "p50": middle, "max": high}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=30, help="number of trajectories")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(arguments)
    need("cyclonedds")
    network = private_network.enter()
    if isinstance(network, private_network.Refused):
        sys.exit(f"needs a private network: {network.reason}")
    text = json.dumps(measure(given.count), indent=2, ensure_ascii=False)
    print(text)
    if given.json is not None:
        given.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
