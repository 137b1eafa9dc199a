"""ONNX models with one input and one output, run by onnxruntime."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row
from catenary.errors import ConfigurationError

TYPES: dict[str, type[np.floating[Any]]] = {
    "tensor(float)": np.float32,
    "tensor(double)": np.float64,
}
WRAP = "wrap the model in a function, and pass the function: Policy(function, ...)"


@runtime_checkable
class Session(Protocol):
    """The part of `onnxruntime.InferenceSession` that a policy uses."""

    def get_inputs(self) -> Sequence[Any]:
        """Return the inputs of the model."""
        ...

    def get_outputs(self) -> Sequence[Any]:
        """Return the outputs of the model."""
        ...

    def run(self, names: Sequence[str] | None, feed: dict[str, Any]) -> Sequence[Any]:
        """Compute the named outputs."""
        ...


def open_session(path: Path) -> Session:
    """Load an ONNX file for one thread without busy-waiting, on the processor.

    Raises ConfigurationError if onnxruntime or the file is missing, or the file is not valid.
    """
    try:
        runtime: Any = import_module("onnxruntime")
    except ImportError as error:
        raise ConfigurationError(
            "onnxruntime, which runs ONNX policies, is not installed",
            hint="pip install 'catenary[policy]'",
        ) from error
    if not path.is_file():
        raise ConfigurationError(f"{path}: the policy file does not exist")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = runtime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        session: Session = runtime.InferenceSession(
            str(path), options, providers=["CPUExecutionProvider"]
        )
    except Exception as error:  # onnxruntime has an own class for each cause
        raise ConfigurationError(
            f"{path}: onnxruntime rejects the policy: {error}",
            hint="export the policy to ONNX again, with an opset that this onnxruntime supports",
        ) from error
    return session


class OnnxModel:
    """A loaded model, called with an observation (n,).

    Args:
        session: onnxruntime session.
        inputs: expected number of values of the input, n.
        outputs: expected number of values of the output, m.
        name: name for error messages.

    Raises:
        ConfigurationError: The model has several inputs or outputs, or their type or shape differs.
    """

    def __init__(self, session: Session, inputs: int, outputs: int, name: str) -> None:
        self._session = session
        given = _only(name, "input", session.get_inputs())
        result = _only(name, "output", session.get_outputs())
        self._shape = _shape(name, "input", given, inputs)
        _shape(name, "output", result, outputs)
        self._type = _type(name, "input", given)
        _type(name, "output", result)
        self._input, self._outputs = str(given.name), [str(result.name)]

    def __call__(self, observation: Row) -> npt.NDArray[Any]:
        """Return the output of the model for an observation (n,)."""
        values = observation.astype(self._type).reshape(self._shape)
        result: npt.NDArray[Any] = self._session.run(self._outputs, {self._input: values})[0]
        return result


def _only(name: str, kind: str, found: Sequence[Any]) -> Any:
    if len(found) != 1:
        names = ", ".join(str(each.name) for each in found) or "none"
        raise ConfigurationError(
            f"{name}: the model has {len(found)} {kind}s ({names}), expected one", hint=WRAP
        )
    return found[0]


def _shape(name: str, kind: str, tensor: Any, count: int) -> tuple[int, ...]:
    """Return (count,) or (1, count). A dimension that is not a number may have any size."""
    shape = list(tensor.shape)
    *batch, last = shape or [0]
    fits = len(batch) <= 1 and all(size == 1 or not isinstance(size, int) for size in batch)
    if not fits or (isinstance(last, int) and last != count):
        raise ConfigurationError(
            f"{name}: the {kind} {tensor.name!r} has shape {shape}, expected [{count}] or "
            f"[1, {count}]",
            hint=f"check the number of {kind}s of Policy(...), or export the model for one sample",
        )
    return (1, count) if batch else (count,)


def _type(name: str, kind: str, tensor: Any) -> type[np.floating[Any]]:
    found = TYPES.get(str(tensor.type))
    if found is None:
        raise ConfigurationError(
            f"{name}: the {kind} {tensor.name!r} has the type {tensor.type}, expected one of "
            f"{', '.join(TYPES)}",
            hint=WRAP,
        )
    return found
