"""Units of the values that a loop publishes."""

from __future__ import annotations

import pytest

from catenary.loop.publishing import unit_of


@pytest.mark.parametrize(
    ("kinds", "unit"),
    [((), "rad"), ((False,), "rad"), ((True,), "m"), ((False, True), "rad or m")],
)
def test_positions_have_the_units_of_the_axes(kinds: tuple[bool, ...], unit: str) -> None:
    assert unit_of("commanded_position", kinds) == unit
    assert unit_of("wake_ns", kinds) == "ns"
    assert unit_of("statusword", kinds) == ""
