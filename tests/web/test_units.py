"""Tests of the page's logic, run by node:test."""

from __future__ import annotations

import subprocess
from pathlib import Path

WEB = Path(__file__).parents[2] / "web"


def test_logic_of_the_page(node: str) -> None:
    run = subprocess.run(
        [node, "test/run.mjs"], cwd=WEB, capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr


def test_types(node: str) -> None:
    compiler = WEB / "node_modules/typescript/bin/tsc"
    run = subprocess.run(
        [node, str(compiler), "--noEmit"],
        cwd=WEB,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
