"""Doubles of libethercat with the interfaces of its releases."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.igh.double import Double, build


@pytest.fixture(scope="session")
def doubles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Release → path."""
    folder = tmp_path_factory.mktemp("igh")
    return {each: build(folder, each) for each in ("1.5.2", "1.5.3", "1.6-alpha", "1.6.1")}


@pytest.fixture(params=["1.5.2", "1.6.1"])
def double(doubles: dict[str, Path], request: pytest.FixtureRequest) -> Double:
    """Two drives, behind the oldest and a newer interface."""
    return Double(doubles[request.param])
