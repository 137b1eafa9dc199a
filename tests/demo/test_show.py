"""A short run of the whole demo in this process."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from catenary.cli.main import main
from catenary.demo.result import PHASES
from catenary.figures import FIGURES


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo") / "out"
    assert main(["demo", "--in-process", "--seconds", "0.2", "--out", str(folder)]) == 0
    return folder


def test_json(folder: Path) -> None:
    found = json.loads((folder / "demo.json").read_text())
    assert [device["position"] for device in found["devices"]] == list(range(6))
    assert {device["state"] for device in found["devices"]} == {"OP"}
    assert found["cycles"] >= 100
    assert found["link"] == "in-process"
    assert isinstance(found["scheduling"], str)
    assert set(found["tracking_error_rad"]) == {"rms", "max"}
    assert set(found["timing_us"]) == set(PHASES)
    for figures in found["timing_us"].values():
        assert set(figures) == set(FIGURES)
        assert figures["min"] <= figures["p50"] <= figures["p99"] <= figures["max"]


def test_page(folder: Path) -> None:
    page = (folder / "demo.html").read_text()
    assert page.startswith("<!doctype html>")
    assert page.count("<polyline") == 3 * 3  # references, positions, errors


def test_the_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["demo", "--in-process", "--seconds", "0.05", "--out", str(tmp_path)])
    printed = capsys.readouterr().out
    assert "no real frames (--in-process)" in printed
    assert "\r" not in printed  # no progress bar without a terminal
    assert "in_controller" in printed
    assert " late, " in printed
    assert "against the set-point that had reached the drive" in printed
    assert "transport delay 2 ms" in printed
    assert str(tmp_path / "demo.html") in printed
