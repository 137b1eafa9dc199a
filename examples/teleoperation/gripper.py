"""Gripper of two fingers in position mode, which other programs command: glove.py, or ROS 2.

    python gripper.py               virtual drives; the left finger meets a block
    python gripper.py eth0          drives at a network interface

The fingers hold while no program has a lease of them, and after a lease has expired.
"""

import argparse
import sys
from contextlib import contextmanager
from pathlib import Path

import catenary as cat
from catenary import realtime
from catenary.virtual import Joint, Plant, Segment, Servo

HERE = Path(__file__).parent
PERIOD = 1e-3  # [s]
FINGERS = "left", "right"  # as in glove.toml
LIMITS = {  # a finger at an obstacle presses with at most the torque limit, by 0x6072
    "velocity_limit": 2.0,
    "position_min": -0.7,
    "position_max": 1.1,
    "torque_limit": 0.3,
    "columns": ["max_torque"],
}


def virtual_gripper(*, clock="virtual"):
    """Return a segment with two drives that move the fingers."""
    servo = Servo(axes=len(FINGERS), inertia=1.5e-3, viscous_friction=0.02, coulomb_friction=2e-3)
    plant = Plant(HERE / "follower.xml", [Joint(name) for name in FINGERS])
    return Segment([servo], plant=plant, clock=clock)


@contextmanager
def gripper(target, name, *, watchdog=0.02):
    """Yield a loop with the fingers, the fingers, and the share `name` of the loop.

    `watchdog` [s] is that of the drives.
    """
    options = {"period": PERIOD, "execution": "inline", "watchdog": watchdog}
    with cat.MainDevice(target) as main:
        drives = main.scan().drives
        hand = cat.Drives(drives, mode="csp", names=FINGERS, counts_per_turn=2**20, **LIMITS)
        with cat.Share(name) as share, cat.Loop(hand, sink=share, **options) as loop:
            yield loop, hand, share


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", nargs="?", help="network interface; default: virtual drives")
    parser.add_argument("--share", default="gripper", help="name of the share; default: gripper")
    given = parser.parse_intermixed_args()
    target = given.target or virtual_gripper(clock="monotonic")
    watchdog = 0.02 if given.target else 0.5  # virtual drives run on busy machines
    running = gripper(target, given.share, watchdog=watchdog)
    with realtime.session(best_effort=True), running as (loop, hand, share):
        print(f"the share {given.share!r} has the fingers {', '.join(hand.names)}", flush=True)
        for _ in loop:
            for end in share.apply(hand):
                print(end, flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
    except (ValueError, cat.CatenaryError) as error:
        sys.exit(f"error: {error}")
