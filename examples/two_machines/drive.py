"""Drive a mobile base and watch the arm on it: two processes in one ROS 2 graph.

python robot.py base      # on the computer of the base
python robot.py arm       # on the computer of the arm, or on the same one
python drive.py base arm  # on any machine of the graph
"""

import sys
import time
from functools import partial

from catenary.ros2 import messages
from catenary.ros2.backend import COMMAND, STATE, open_backend

SPEED, TURN, RATE = 1.0, 2.0, 50.0  # [rad/s], [rad], [Hz]
TIMEOUT = 30.0  # [s]


def until(node, condition, what, act=lambda: None):
    """Run the node and `act` until the condition holds; exit with a message after TIMEOUT."""
    end = time.monotonic() + TIMEOUT
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"timeout: {what}")
        act()
        node.spin_once(1 / RATE)


def main(base, arm):
    node = open_backend("drive")
    states = {}
    for name in (base, arm):
        receive = partial(states.__setitem__, name)
        node.subscription(f"/{name}/joint_states", messages.JointState, STATE, receive)
    wheels = node.publisher(f"/{base}/wheel_velocities", messages.Float64MultiArray, COMMAND)
    until(node, lambda: len(states) == 2 and wheels.matched, f"{base} or {arm} is not in the graph")
    start = states[base].position[0]
    forward = messages.Float64MultiArray(data=[SPEED, SPEED])
    until(
        node,
        lambda: states[base].position[0] - start > TURN,
        "the wheels do not turn",
        lambda: wheels.publish(forward),
    )
    # Without further commands, the wheels stop after the time-out in base.toml.
    until(node, lambda: max(map(abs, states[base].velocity)) < 0.01, "the wheels have not stopped")
    print(f"{base}: wheels turned by {states[base].position[0] - start:.2f} rad, and stopped")
    print(f"{arm}: {len(states[arm].name)} joints hold")
    node.close()


if __name__ == "__main__":
    main(*(sys.argv[1:] or ["base", "arm"]))
