"""Move two arms of two machines at the same time, through one ROS 2 graph.

python robot.py arm --name left      # on the first machine
python robot.py arm --name right     # on the second machine
python together.py left right        # on any machine of the graph

Both arms get the same trajectory with the same start time. The clocks of the machines must
therefore be synchronised.
"""

import sys
import time

from catenary.ros2 import messages
from catenary.ros2.backend import COMMAND, STATE, open_backend

TURN, DURATION, DELAY = 0.3, 2.0, 1.0  # [rad], [s], [s] until the start
TIMEOUT = 30.0  # [s]


class Arm:
    """Topics of one arm."""

    def __init__(self, node, name):
        self.name = name
        self.state = None
        node.subscription(f"/{name}/joint_states", messages.JointState, STATE, self.receive)
        kind = messages.JointTrajectory
        self.trajectory = node.publisher(f"/{name}/joint_trajectory", kind, COMMAND)

    def receive(self, state):
        self.state = state

    @property
    def ready(self):
        return self.state is not None and self.trajectory.matched > 0

    def turn(self, start_ns):
        """Turn all joints by TURN, from `start_ns` [ns, UTC] on."""
        positions = [position + TURN for position in self.state.position]
        point = messages.JointTrajectoryPoint(
            positions, time_from_start=messages.Duration.from_seconds(DURATION)
        )
        header = messages.Header(messages.Time.from_ns(start_ns))
        names = list(self.state.name)
        self.trajectory.publish(messages.JointTrajectory(header, names, [point]))
        self.goal = positions

    @property
    def arrived(self):
        errors = (a - b for a, b in zip(self.goal, self.state.position, strict=True))
        return max(map(abs, errors)) < 0.001


def until(node, condition, what):
    """Run the node until the condition holds; exit with a message after TIMEOUT."""
    end = time.monotonic() + TIMEOUT
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"timeout: {what}")
        node.spin_once(0.1)


def main(names):
    node = open_backend("together")
    arms = [Arm(node, name) for name in names]
    until(node, lambda: all(arm.ready for arm in arms), "not all arms are in the graph")
    start_ns = time.time_ns() + round(DELAY * 1e9)
    for arm in arms:
        arm.turn(start_ns)
    until(node, lambda: all(arm.arrived for arm in arms), "not all arms have arrived")
    for arm in arms:
        print(f"{arm.name}: {', '.join(f'{p:.3f}' for p in arm.state.position)} rad")
    node.close()


if __name__ == "__main__":
    main(sys.argv[1:] or ["left", "right"])
