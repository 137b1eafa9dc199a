"""Capabilities are given to the Python of one environment, never to that of the machine."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from catenary import interpreter


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """Return the folder of a machine's Python."""
    place = tmp_path / "usr" / "bin" / "python3"
    place.parent.mkdir(parents=True)
    place.touch()
    return tmp_path / "usr"


def environment(tmp_path: Path, system: Path, *, copies: bool) -> Path:
    python = tmp_path / "venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    if copies:
        python.touch()
    else:
        python.symlink_to(system / "bin" / "python3")
    return tmp_path / "venv"


def advice(monkeypatch: pytest.MonkeyPatch, prefix: Path, base: Path, name: str) -> str:
    monkeypatch.setattr(sys, "executable", str(prefix / "bin" / name))
    monkeypatch.setattr(sys, "prefix", str(prefix))
    monkeypatch.setattr(sys, "base_prefix", str(base))
    return interpreter.permission_advice()


def test_a_copied_interpreter_gets_the_capabilities(
    tmp_path: Path, system: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prefix = environment(tmp_path, system, copies=True)
    said = advice(monkeypatch, prefix, system, "python")
    assert said.startswith(f"sudo setcap {interpreter.CAPABILITIES} {prefix}/bin/python;")
    assert "every user who can run this file gets raw sockets" in said


def test_a_linked_interpreter_does_not_get_them(
    tmp_path: Path, system: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prefix = environment(tmp_path, system, copies=False)
    said = advice(monkeypatch, prefix, system, "python")
    assert "`python3 -m venv --copies .venv`" in said
    assert f"setcap {interpreter.CAPABILITIES} .venv/bin/python;" in said
    assert f"{system}/bin/python3 also runs other programs" in said


def test_the_python_of_the_machine_does_not_get_them(
    system: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "venv --copies" in advice(monkeypatch, system, system, "python3")


def test_a_conda_environment_gets_the_capabilities(
    system: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (system / "conda-meta").mkdir()
    assert advice(monkeypatch, system, system, "python3").startswith("sudo setcap")
