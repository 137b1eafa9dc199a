"""Balance policy for the policy slot `catenary.control.Policy`, generated as an ONNX model.

    python examples/humanoid/policy.py out/humanoid/balance.onnx    # needs `pip install onnx`

The policy is linear: the LQR of `lqr.py`, designed for 100 Hz. It stands for a learned policy with
the same interface:

- observation, float32 (1, 78): differences from the standing pose: position and rotation of the
  pelvis (6), joints (33), and their velocities (39), as `LinearModel.state` returns them
- action, float32 (1, 33): offsets of the joint goals from the standing pose [rad], -LIMIT to LIMIT
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import body
import numpy as np
from estimate import Estimate
from lqr import LinearModel, riccati

PERIOD = 0.01  # [s]
LIMIT = 0.2  # [rad]
OBSERVATION, ACTION = 78, len(body.STAND)
OPSET, IR_VERSION = 13, 8  # old enough for all current versions of onnxruntime


def weights(path: str | Path = body.MODEL) -> np.ndarray:
    """Return the offsets of the goals per observation, float32 (33, 78)."""
    model = LinearModel(path, period=PERIOD)
    feedback = riccati(model.transition, model.effect, *model.cost())
    return (-feedback / body.STIFFNESS[:, None]).astype(np.float32)


def make(matrix: np.ndarray) -> Any:
    """Return the ONNX model of a linear policy with limited actions.

    Args:
        matrix: float32 (actions, observations).

    Raises:
        ImportError: `onnx` is not installed.
    """
    from onnx import TensorProto, checker, helper, numpy_helper

    actions, observations = matrix.shape
    constants = {"weights": matrix, "low": np.float32(-LIMIT), "high": np.float32(LIMIT)}
    graph = helper.make_graph(
        [
            helper.make_node("Gemm", ["observation", "weights"], ["offset"], transB=1),
            helper.make_node("Clip", ["offset", "low", "high"], ["action"]),
        ],
        "balance",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, observations])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, actions])],
        [numpy_helper.from_array(np.asarray(each), name) for name, each in constants.items()],
    )
    model = helper.make_model(
        graph,
        producer_name="catenary examples/humanoid",
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
    )
    checker.check_model(model)
    return model


def write(file: str | Path, path: str | Path = body.MODEL) -> Path:
    """Write the policy to a file, and return its path.

    Args:
        file: Path of the ONNX file.
        path: The MJCF file of the humanoid.

    Raises:
        ImportError: `onnx` is not installed.
    """
    file = Path(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(make(weights(path)).SerializeToString())
    return file


class PolicyBalance:
    """Balance by a policy at 100 Hz, with the interface of `balance.Balance`.

    Args:
        policy: Function of an observation (78,) that returns an action (33,), and the time [s].
            `catenary.control.Policy.step` is such a function.
        path: The MJCF file of the humanoid.
    """

    def __init__(
        self,
        policy: Callable[[np.ndarray, float], np.ndarray],
        path: str | Path = body.MODEL,
    ) -> None:
        self._policy = policy
        self._model = LinearModel(path, period=PERIOD)
        self.goal = body.STAND.copy()
        self.reset()

    def observation(self, estimate: Estimate) -> np.ndarray:
        """Return the observation, float32 (78,)."""
        return self._model.state(estimate).astype(np.float32)

    def step(self, estimate: Estimate, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the goals (33,) [rad] and torques (33,) [N·m] of the joints.

        The goals are those of the standing pose while the estimate is not reliable.

        Args:
            estimate: State of the body.
            dt: Time since the previous step [s].
        """
        self._time += dt
        if not estimate.reliable:
            self.goal = body.STAND.copy()
        elif self._time >= self._next:
            self._next += PERIOD
            self.goal = body.STAND + self._policy(self.observation(estimate), self._time)
        return self.goal.copy(), self._model.static_torque.copy()

    def reset(self) -> None:
        """Start with the standing pose."""
        self.goal = body.STAND.copy()
        self._time = self._next = 0.0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Write the balance policy as an ONNX model.")
    parser.add_argument("file", type=Path, help="path of the ONNX file")
    print(write(parser.parse_args().file))
