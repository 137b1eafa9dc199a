"""Poses of an operator for the hands, from ROS 2 (`geometry_msgs/PoseStamped`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial

import body
import hand
import numpy as np

import catenary as cat
from catenary.ros2 import backend, messages

TOPICS = tuple(f"{side}_hand_pose" for side in body.SIDES)


class PoseSource:
    """Owner of the newest accepted pose (7,) of each hand: x, y, z [m], quaternion w, x, y, z.

    Args:
        node: node of ROS 2, which receives the poses.
    """

    def __init__(self, node: backend.Backend) -> None:
        self._poses: list[np.ndarray | None] = [None for _ in TOPICS]
        self._refused = [False for _ in TOPICS]  # reported until the next accepted pose
        self._node = node
        for side, topic in enumerate(TOPICS):
            take = partial(self._take, side)
            node.subscription(topic, messages.PoseStamped, backend.COMMAND, take)

    def step(self) -> Sequence[np.ndarray | None]:
        """Receive messages. Return the newest accepted pose of each hand; None if there is none."""
        self._node.spin_once(0.0)
        return self._poses

    def drop(self) -> None:
        """Forget the poses, until the next messages."""
        self._poses = [None for _ in TOPICS]

    def _take(self, side: int, message: messages.PoseStamped) -> None:
        at, turn = message.pose.position, message.pose.orientation
        pose = np.array([at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z])
        reason = hand.refusal(side, message.header.frame_id, pose)
        if reason is None:
            self._poses[side] = pose
        elif not self._refused[side]:
            print(f"{TOPICS[side]}: refused: {reason}", flush=True)
        self._refused[side] = reason is not None


@contextmanager
def pose_source(namespace: str) -> Iterator[PoseSource | None]:
    """Yield a source on a node of ROS 2; None without `pip install 'catenary[ros2]'` and rclpy."""
    try:
        node = backend.open_backend("hand", namespace=namespace)
    except cat.errors.ConfigurationError as error:
        print(f"ROS 2: the hands follow no poses: {error}")
        yield None
        return
    with closing(node):
        yield PoseSource(node)
