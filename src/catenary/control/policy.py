"""Slot for a learned or generated policy: an ONNX model or a Python function, with safe actions.

    rule = control.ActionRule(outputs=12, low=-0.2, high=0.2, rate=2.0)
    policy = control.Policy("balance.onnx", inputs=40, rule=rule)
    action = policy.step(observation, now)

A policy maps an observation (n,) to an action (m,). The model has one input `[1, n]` or `[n]`, and
one output `[1, m]` or `[m]`, both float32 or float64. Names of the tensors do not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt

from catenary.control.action_rule import ActionGuard, ActionRule, ActionStatus, checked_time, fault
from catenary.control.compiles import Row
from catenary.control.onnx_model import OnnxModel, Session, open_session
from catenary.errors import ConfigurationError

Function = Callable[[Row], npt.ArrayLike]


class Policy:
    """A policy with limited actions, and a stated fallback for bad outputs.

    `step` never raises an error of the policy, and never returns NaN. If an output is NaN, infinite
    or of a wrong shape, or the policy raises an exception, the action follows the fallback of the
    rule. `status` gives the reason. A NaN in the observation has the same effect, and the policy is
    not called.

    A policy may compute for too long. Run it in a task of its own, write its actions to a
    `realtime.Value`, and read them with an `ActionReader`, which applies the same rule to a late
    policy. A Policy of a file or of a function of a module can be an argument of such a task.

    Args:
        source: ONNX file, onnxruntime session, or a function of an observation (n,) that returns
            an action (m,). A function may keep a state, such as that of a recurrent network.
        inputs: number of values of an observation, n.
        rule: number of outputs, limits and fallback.

    Raises:
        ConfigurationError: onnxruntime or the file is missing, the file is not a valid model, or
            its inputs or outputs have another number, type or shape.
        ValueError: `inputs` is less than 1.
    """

    def __init__(
        self, source: str | PathLike[str] | Session | Function, *, inputs: int, rule: ActionRule
    ) -> None:
        if inputs < 1:
            raise ValueError(f"inputs={inputs}; a policy needs at least one input")
        self._rebuild = partial(Policy, source, inputs=inputs, rule=rule)
        self._function = _function(source, inputs, rule.outputs)
        self._inputs = inputs
        self._guard = ActionGuard(rule)
        self._now = 0.0

    def __reduce__(self) -> tuple[partial[Policy], tuple[()]]:
        return self._rebuild, ()

    def step(self, observation: npt.ArrayLike, now: float) -> Row:
        """Compute the action for an observation.

        Args:
            observation: (n,), in the unit and order of the policy.
            now: current time [s], on any clock that only advances.

        Returns:
            Action (m,), finite and within the limits of the rule.

        Raises:
            ValueError: `observation` does not have the shape (n,), or `now` is not finite.
        """
        row = np.array(observation, dtype=np.float64)
        if row.shape != (self._inputs,):
            raise ValueError(f"observation has shape {row.shape}, expected ({self._inputs},)")
        self._now = checked_time(now)
        self._compute(row, now)
        return self._guard.action(now)

    @property
    def status(self) -> ActionStatus:
        """State of the action after the last step, with the reason of a fallback."""
        return self._guard.status(self._now)

    def _compute(self, observation: Row, now: float) -> None:
        bad = np.flatnonzero(~np.isfinite(observation))
        if len(bad):
            value = observation[bad[0]]
            self._guard.refuse(f"observation {bad[0]} of {self._inputs} is {value}")
            return
        try:
            output = self._function(observation)
        except Exception as error:  # any error of the policy has the fallback, and is reported
            self._guard.refuse(f"the policy failed: {type(error).__name__}: {error}")
        else:
            self._guard.accept(output, now)


def _function(
    source: str | PathLike[str] | Session | Function, inputs: int, outputs: int
) -> Function:
    """Return the policy as a function. Run a model once, to check the shape of its output."""
    if isinstance(source, (str, PathLike)):
        model = OnnxModel(open_session(Path(source)), inputs, outputs, str(source))
    elif isinstance(source, Session):
        model = OnnxModel(source, inputs, outputs, "session")
    else:
        return source
    if reason := _trial(model, inputs, outputs):
        raise ConfigurationError(
            f"{source}: {reason}",
            hint="check the outputs of ActionRule(...), or export the model for one sample",
        )
    return model


def _trial(model: OnnxModel, inputs: int, outputs: int) -> str:
    """Return the reason why a model does not fit; empty if it does. NaN is not a reason."""
    try:
        output = model(np.zeros(inputs))
    except Exception as error:  # onnxruntime has an own class for each cause
        return f"onnxruntime cannot run the model: {error}"
    return fault(np.zeros(output.shape), outputs)
