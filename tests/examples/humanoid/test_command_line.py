"""Mistakes on the command line of the humanoid are refused before anything starts."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("numba", reason="laws need Numba: pip install 'catenary[law]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")

import body
import humanoid

PROGRAM = body.MODEL.with_name("humanoid.py")


def refused(folder: Path, *arguments: str) -> str:
    """Return the last line of the error output."""
    command = [sys.executable, str(PROGRAM), "--out", str(folder), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode in (1, 2)
    assert "Traceback" not in done.stderr
    return done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["dance"], "unknown scenarios dance; known: stand"),
        (["--hertz", "0"], "--hertz: 0 is not a positive number"),
        (["--silence", "-1"], "--silence: -1 is not a positive number"),
        (["--model", "none.xml"], "--model: the file none.xml does not exist"),
        (["--policy", "none.onnx"], "--policy: the file none.onnx does not exist"),
        (["--page", "push"], "--page runs no scenario"),
    ],
)
def test_a_mistake_is_named(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", [str(PROGRAM), "--out", str(tmp_path), *arguments])
    with pytest.raises(SystemExit) as ended:
        humanoid.main()
    assert ended.value.code == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_the_model_of_another_robot_is_refused(tmp_path: Path) -> None:
    model = tmp_path / "other.xml"
    text = body.MODEL.read_text()
    model.write_text(text.replace('joint name="left_knee"', 'joint name="left_wheel"'))
    assert "is not this humanoid: missing joints" in refused(tmp_path, "--model", str(model))


def test_a_port_that_is_in_use_is_refused(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        command = [sys.executable, str(PROGRAM), "--page", "--port", port, "--out", str(tmp_path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert f"humanoid.py: port {port} of the page: Address already in use" in done.stderr


def test_a_file_that_is_not_a_policy_is_refused(tmp_path: Path) -> None:
    model = tmp_path / "policy.onnx"
    model.write_bytes(b"not a model")
    line = refused(tmp_path, "--policy", str(model), "stand")
    assert "export the policy to ONNX again" in line or "pip install 'catenary[policy]'" in line
