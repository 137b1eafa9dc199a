"""Simulated glove that commands the fingers of gripper.py, without ROS 2.

    python gripper.py               in one terminal
    python glove.py                 in another one

The file glove.toml maps the joints of the glove to the fingers, as it does for `catenary ros2`.
For a glove of your own, write a function like `glove`: it returns the names and positions of the
joints [rad], or None without a new message.
"""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

import catenary as cat
from catenary.ros2.config_file import read_config
from catenary.ros2.forward import CommandError
from catenary.ros2.joint_map import JointMap

HERE = Path(__file__).parent
SPEED = 1.0  # [rad/s], of a finger that approaches the position of the glove
ENABLED = 10.0  # [s] until the drives of the gripper are enabled


class JointState(NamedTuple):
    """Names and positions of joints, as in `sensor_msgs/JointState`."""

    name: tuple[str, ...]
    position: tuple[float, ...]  # [rad]


def glove(now):
    """Return the joints of a hand that closes and opens once in 4 s."""
    bent = 0.5 - 0.5 * math.cos(0.5 * math.pi * now)
    return JointState(("thumb_flexion", "index_flexion", "wrist"), (bent, 1.4 * bent, 0.1))


class Fingers:
    """Owner of the commanded positions of the fingers.

    Args:
        commands: table `[commands]` of glove.toml.
        position: positions at the begin [rad].
    """

    def __init__(self, commands, position):
        self.timeout = commands.joint_states.timeout
        self.joints = JointMap(commands.joint_states.axes, commands.axes)
        self.position = np.array(position, float)
        self.goal, self.age = None, 0.0
        self.refused = ""  # reason for which the newest message was refused

    def step(self, message, dt):
        """Return the next positions [rad]. They hold without a message for `timeout`."""
        self.age += dt
        if message is not None:
            self.accept(message)
        if self.goal is not None and self.age <= self.timeout:
            self.position += np.clip(self.goal - self.position, -SPEED * dt, SPEED * dt)
        return self.position

    def accept(self, message):
        """Take over the goal of a message, or the reason why it is refused."""
        try:
            self.goal, self.age, self.refused = self.joints(message), 0.0, ""
        except CommandError as error:
            self.refused = error.message


def follow(gripper, commands, seconds):
    """Command the fingers until the gripper ends, or the time has passed."""
    dt = 1.0 / commands.rate
    row = enabled(gripper, commands.axes)
    fingers = Fingers(commands, row["commanded_position"][places(gripper, commands.axes)])
    begun, count, refused = time.monotonic(), 0, ""
    with gripper.lease(axes=commands.axes, for_=commands.lease) as lease:
        while gripper.alive and (seconds is None or count * dt < seconds):
            lease.send(position=fingers.step(glove(count * dt), dt))
            if fingers.refused != refused:
                refused = fingers.refused
                print(refused or "messages are accepted again", flush=True)
            count += 1
            time.sleep(max(begun + count * dt - time.monotonic(), 0.0))
        print("fingers at", *(f"{each:.2f}" for each in fingers.position), "rad", flush=True)


def places(gripper, axes):
    """Return the numbers of axes in the rows of a share."""
    missing = [name for name in axes if name not in gripper.layout.axes]
    if missing:
        known = ", ".join(gripper.layout.axes)
        raise ValueError(f"the share has no axis {missing[0]!r} of the mapping; it has {known}")
    return [gripper.layout.axes.index(name) for name in axes]


def enabled(gripper, axes):
    """Return the first cycle in which all drives are enabled. Raises TimeoutError if none is."""
    until = time.monotonic() + ENABLED
    while gripper.wait(timeout=1.0) and time.monotonic() < until:
        row = gripper.read()
        if row["enabled"][places(gripper, axes)].all():
            return row
    raise TimeoutError(f"the drives of the gripper were not enabled within {ENABLED:g} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--share", default="gripper", help="share of gripper.py; default: gripper")
    parser.add_argument(
        "--config", type=Path, default=HERE / "glove.toml", help="mapping; default: glove.toml"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="duration; default: Ctrl-C")
    given = parser.parse_args()
    commands = read_config(given.config).commands
    if commands.joint_states is None or commands.axes is None:
        raise ValueError(f"{given.config}: give commands.axes and [commands.joint_states]")
    with cat.attach(given.share) as gripper:
        follow(gripper, commands, given.seconds)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
    except (ValueError, TimeoutError, cat.CatenaryError) as error:
        sys.exit(f"error: {error}")
