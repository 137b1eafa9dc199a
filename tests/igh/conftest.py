"""Doubles of libethercat with the interfaces of its releases."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.igh import Master
from tests.igh.double import Double, build


@pytest.fixture(scope="session")
def doubles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the paths of the doubles, by release."""
    folder = tmp_path_factory.mktemp("igh")
    return {each: build(folder, each) for each in ("1.5.2", "1.5.3", "1.6-alpha", "1.6.1")}


@pytest.fixture(params=["1.5.2", "1.6.1"])
def double(doubles: dict[str, Path], request: pytest.FixtureRequest) -> Double:
    """Yield a double with two drives, with the oldest and a newer interface."""
    return Double(doubles[request.param])


@pytest.fixture
def main(double: Double) -> Iterator[cat.MainDevice]:
    """Yield a scanned MainDevice on the double."""
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        yield main
