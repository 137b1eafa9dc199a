"""The policy slot: functions and ONNX models, checks at load, and the fallback for bad outputs."""

import math
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catenary import control
from catenary.errors import ConfigurationError

RULE = control.ActionRule(2, low=-1.0, high=1.0, hold=0.03, decay=0.1)
GAIN = np.array([[0.1, 0.2, 0.3], [0.0, -0.5, 1.0]])


def linear(observation: np.ndarray) -> np.ndarray:
    return GAIN @ observation


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes an ONNX file with y = x Aᵀ."""
    onnx = pytest.importorskip("onnx", reason="onnx makes the models: pip install onnx")
    pytest.importorskip("onnxruntime", reason="pip install 'catenary[policy]'")

    def make(gain: np.ndarray = GAIN, shape: Any = ("batch", 3), kind: str = "float") -> Path:
        helper, types = onnx.helper, onnx.TensorProto
        element = {"float": types.FLOAT, "double": types.DOUBLE, "int": types.INT64}[kind]
        weights = onnx.numpy_helper.from_array(
            gain.T.astype({"float": "f4", "double": "f8", "int": "i8"}[kind]), "weights"
        )
        result = [*shape[:-1], len(gain)]
        graph = helper.make_graph(
            [helper.make_node("MatMul", ["observation", "weights"], ["action"])],
            "policy",
            [helper.make_tensor_value_info("observation", element, list(shape))],
            [helper.make_tensor_value_info("action", element, result)],
            [weights],
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        path = tmp_path / "policy.onnx"
        onnx.save(model, str(path))
        return path

    return make


@pytest.mark.parametrize("shape", [("batch", 3), (1, 3), (3,)])
@pytest.mark.parametrize("kind", ["float", "double"])
def test_an_onnx_policy_equals_the_same_function(
    made: Callable[..., Path], shape: Any, kind: str
) -> None:
    policy = control.Policy(made(shape=shape, kind=kind), inputs=3, rule=RULE)
    given = np.array([0.5, -0.4, 0.3])
    assert policy.step(given, 0.0) == pytest.approx(linear(given), abs=1e-6)
    assert policy.status.phase == "ok"


def test_a_session_and_a_pickled_policy_give_the_same_actions(made: Callable[..., Path]) -> None:
    path, given = made(), np.array([0.5, -0.4, 0.3])
    session = pytest.importorskip("onnxruntime").InferenceSession(
        str(path), providers=["CPUExecutionProvider"]
    )
    expected = control.Policy(path, inputs=3, rule=RULE).step(given, 0.0)
    copy = pickle.loads(pickle.dumps(control.Policy(path, inputs=3, rule=RULE)))
    assert control.Policy(session, inputs=3, rule=RULE).step(given, 0.0).tolist() == list(expected)
    assert copy.step(given, 0.0).tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"gain": GAIN[:, :2], "shape": (1, 2)},
            r"input 'observation' has shape .*1, 2.*3",
        ),
        ({"gain": GAIN[:1]}, r"output 'action' has shape \['batch', 1\], expected \[2\]"),
        ({"shape": (4, 3)}, r"has shape \[4, 3\], expected \[3\] or \[1, 3\]"),
        ({"shape": (1, 1, 3)}, r"has shape \[1, 1, 3\], expected"),
        ({"kind": "int"}, r"has the type tensor\(int64\), expected one of tensor\(float\)"),
        ({"gain": GAIN[:, :2], "shape": ("batch", "n")}, "onnxruntime cannot run the model"),
    ],
)
def test_a_model_of_another_shape_or_type_is_refused_at_load(
    made: Callable[..., Path], options: dict, message: str
) -> None:
    path = made(**options)
    with pytest.raises(ConfigurationError, match=message):
        control.Policy(path, inputs=3, rule=RULE)


class Two:
    """A session of a model with two inputs."""

    def get_inputs(self) -> list[Any]:
        return [type("Tensor", (), {"name": name}) for name in ("observation", "state")]

    get_outputs = get_inputs

    def run(self, names: Any, feed: Any) -> list[Any]:
        raise NotImplementedError


def test_a_model_with_several_inputs_is_refused_by_name() -> None:
    with pytest.raises(ConfigurationError, match=r"2 inputs \(observation, state\), expected one"):
        control.Policy(Two(), inputs=3, rule=RULE)


def test_missing_or_broken_files_and_a_missing_onnxruntime(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxruntime", reason="pip install 'catenary[policy]'")
    with pytest.raises(ConfigurationError, match=r"none\.onnx: the policy file does not exist"):
        control.Policy(tmp_path / "none.onnx", inputs=3, rule=RULE)
    (tmp_path / "text.onnx").write_text("not a model")
    with pytest.raises(ConfigurationError, match=r"text\.onnx: onnxruntime rejects the policy"):
        control.Policy(str(tmp_path / "text.onnx"), inputs=3, rule=RULE)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ConfigurationError, match=r"pip install 'catenary\[policy\]'"):
        control.Policy(tmp_path / "text.onnx", inputs=3, rule=RULE)


def scripted(*outputs: Any) -> Callable[[np.ndarray], Any]:
    """Return a policy with given outputs in turn; an exception is raised."""
    rest = list(outputs)

    def policy(observation: np.ndarray) -> Any:
        output = rest.pop(0)
        if isinstance(output, Exception):
            raise output
        return output

    return policy


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        ([math.nan, 0.0], "output 0 of 2 is nan"),
        ([0.0, math.inf], "output 1 of 2 is inf"),
        ([0.0, 0.0, 0.0], "the output has shape (3,), expected (2,)"),
        ([[0.0], [0.0]], "the output has shape (2, 1), expected (2,)"),
        (0.0, "the output has shape (), expected (2,)"),
        ([[0.0], [0.0, 1.0]], "the output is not numeric"),
        (None, "the output has shape (), expected (2,)"),
        (["left", "right"], "the output is not numeric"),
        (RuntimeError("no state"), "the policy failed: RuntimeError: no state"),
    ],
)
def test_a_bad_output_keeps_the_last_good_action_and_gives_the_reason(
    bad: Any, reason: str
) -> None:
    policy = control.Policy(scripted([0.5, -0.5], bad, [0.1, 0.1]), inputs=3, rule=RULE)
    assert policy.step(np.zeros(3), 0.0).tolist() == [0.5, -0.5]
    assert policy.step(np.zeros(3), 0.01).tolist() == [0.5, -0.5]
    assert policy.status.phase == "held"
    assert policy.status.reason.startswith(reason)
    assert policy.step(np.zeros(3), 0.02).tolist() == [0.1, 0.1]
    assert (policy.status.phase, policy.status.refused) == ("ok", 1)


def test_lasting_bad_outputs_decay_to_the_neutral_action(made: Callable[..., Path]) -> None:
    """From 50 ms on, an ONNX policy returns NaN: its weights overflow."""
    path = made(gain=np.array([[1e38, 1e38, -1e38], [0.0, 0.0, 0.0]]))
    policy = control.Policy(path, inputs=3, rule=RULE)
    actions, phases = [], []
    for k in range(25):
        given = [1.0, 0.0, 0.0] if k < 5 else [1e30, 1e30, 1e30]
        actions.append(policy.step(given, k * 0.01)[0])
        phases.append(policy.status.phase)
    assert phases == ["ok"] * 5 + ["held"] * 3 + ["decaying"] * 9 + ["neutral"] * 8
    assert np.diff(actions[7:18]) == pytest.approx(np.full(10, -0.1))
    assert actions[17:] == pytest.approx([0.0] * 8, abs=1e-12)
    assert policy.status.refused == 20


def test_a_nan_in_the_observation_does_not_reach_the_policy() -> None:
    policy = control.Policy(scripted([0.5, 0.5]), inputs=3, rule=RULE)
    policy.step(np.zeros(3), 0.0)
    assert policy.step([0.0, math.nan, 0.0], 0.01).tolist() == [0.5, 0.5]
    assert policy.status.reason == "observation 1 of 3 is nan"


def test_a_policy_cannot_change_the_array_of_its_caller() -> None:
    def policy(observation: np.ndarray) -> np.ndarray:
        observation[:] = 9.0
        return observation[:2]

    given = np.zeros(3)
    control.Policy(policy, inputs=3, rule=RULE).step(given, 0.0)
    assert given.tolist() == [0.0, 0.0, 0.0]


def test_an_observation_of_another_length_is_the_callers_mistake() -> None:
    policy = control.Policy(linear, inputs=3, rule=RULE)
    with pytest.raises(ValueError, match=r"observation has shape \(2,\), expected \(3,\)"):
        policy.step([0.0, 0.0], 0.0)
    with pytest.raises(ValueError, match="inputs=0"):
        control.Policy(linear, inputs=0, rule=RULE)
