"""A law is compiled again if a dependency has changed, and only then."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

import catenary as cat
from catenary import control
from catenary.loop.laws.dependencies import dependencies

GAINS = (
    "import numpy as np\nfrom numba import njit\n\n@njit\ndef gain(x):\n    return {factor} * x\n"
)
LAW = """
import sys
import catenary as cat
import gains

OFFSET = {offset}

@cat.law
def follow(actual, target, memory, time):
    memory[0] = gains.gain(1.0) + OFFSET
    return True

with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
    with cat.Loop(arm) as loop:
        print(loop.run(follow, memory=[0.0])[0])
        [code] = loop._opened.laws._compiled.values()
        print(sum(code.code[1].stats.cache_hits.values()))
"""


def write(path: Path, text: str, age: int) -> None:
    """With a time of its own: a clock may be coarse."""
    path.write_text(text)
    os.utime(path, ns=(age * 10**9, age * 10**9))


def ran(folder: Path) -> list[float]:
    """[what the law gave, how often it came from the cache]"""
    environment = {
        **os.environ,
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "XDG_CACHE_HOME": str(folder / "cache"),
    }
    done = subprocess.run(
        [sys.executable, str(folder / "follow.py")],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    return [float(word) for word in done.stdout.split()]


def test_a_changed_function_in_another_file_is_compiled_again(tmp_path: Path) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    write(tmp_path / "gains.py", GAINS.format(factor=2.0), 1000)
    write(tmp_path / "follow.py", LAW.format(offset=0.5), 1000)
    assert ran(tmp_path) == [2.5, 0]
    assert ran(tmp_path) == [2.5, 1]
    write(tmp_path / "gains.py", GAINS.format(factor=3.0), 2000)
    assert ran(tmp_path) == [3.5, 0]


def named(folder: Path, monkeypatch: pytest.MonkeyPatch, offset: object) -> tuple[str, ...]:
    text = "import math\nimport used\nOFFSET = {offset!r}\n"
    text += "def law(memory):\n    memory[0] = used.helper(OFFSET) + math.pi\n"
    write(folder / "lawful.py", text.format(offset=offset), 1000)
    monkeypatch.syspath_prepend(folder)
    for module in ("lawful", "used"):
        sys.modules.pop(module, None)
    importlib.invalidate_caches()
    return dependencies(importlib.import_module("lawful").law)


def test_dependencies_have_values_of_globals_and_stamps_of_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    write(tmp_path / "used.py", "import deeper\ndef helper(x):\n    return x\n", 1000)
    write(tmp_path / "deeper.py", "", 1000)
    first = named(tmp_path, monkeypatch, 1.0)
    assert first == named(tmp_path, monkeypatch, 1.0)
    assert first != named(tmp_path, monkeypatch, 2.0)
    assert any(entry == "OFFSET = 1.0" for entry in first)
    write(tmp_path / "used.py", "import deeper\ndef helper(x):\n    return x\n", 3000)
    assert first != named(tmp_path, monkeypatch, 1.0)


def test_a_package_has_one_stamp_per_file() -> None:
    def direct(memory, parameters):
        control.pid(memory, parameters, 0, 0.0, 0.0, 0.0, 1e-3)

    def through(memory, parameters):
        cat.control.pid(memory, parameters, 0, 0.0, 0.0, 0.0, 1e-3)

    for law in (direct, through):
        files = [entry for entry in dependencies(law) if "control/parts.py" in entry]
        assert len(files) == 1
