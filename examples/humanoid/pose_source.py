"""Poses of an operator for the right hand, from ROS 2 (`geometry_msgs/PoseStamped`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

import hand
import numpy as np

import catenary as cat
from catenary.ros2 import backend, messages

TOPIC = "right_hand_pose"


class PoseSource:
    """Owner of the newest accepted pose (7,): x, y, z [m], quaternion w, x, y, z.

    Args:
        node: node of ROS 2, which receives the poses.
    """

    def __init__(self, node: backend.Backend) -> None:
        self.pose: np.ndarray | None = None
        self._node = node
        node.subscription(TOPIC, messages.PoseStamped, backend.COMMAND, self._take)

    def step(self) -> np.ndarray | None:
        """Receive all messages. Return the newest accepted pose; None if there is none."""
        self._node.spin_once(0.0)
        return self.pose

    def drop(self) -> None:
        """Forget the pose, until the next message."""
        self.pose = None

    def _take(self, message: messages.PoseStamped) -> None:
        at, turn = message.pose.position, message.pose.orientation
        pose = np.array([at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z])
        reason = hand.refusal(message.header.frame_id, pose)
        if reason is None:
            self.pose = pose
        else:
            print(f"{TOPIC}: refused: {reason}", flush=True)


@contextmanager
def pose_source(namespace: str) -> Iterator[PoseSource | None]:
    """Yield a source on a node of ROS 2; None without `pip install 'catenary[ros2]'` and rclpy."""
    try:
        node = backend.open_backend("hand", namespace=namespace)
    except cat.errors.ConfigurationError as error:
        print(f"ROS 2: the hand follows no poses: {error}")
        yield None
        return
    with closing(node):
        yield PoseSource(node)
