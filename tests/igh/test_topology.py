"""Clocks are refused if delays are implausible."""

from __future__ import annotations

import pytest

import catenary as cat
from tests.igh.double import Double
from tests.igh.loops import clocked_loop


@pytest.mark.parametrize("delay", [2_147_000_000, 5_000_000])
def test_implausible_delays_are_refused(main: cat.MainDevice, double: Double, delay: int) -> None:
    """A closed ring causes them. The clocks would agree with each other on a wrong time."""
    double.measured(delay)
    with pytest.raises(cat.errors.ConfigurationError, match="us from device 0"), clocked_loop(main):
        pass
    assert "activate" not in double.calls()
    double.measured(0)
    with clocked_loop(main) as loop:
        assert next(loop).ok


def test_clocks_in_a_closed_ring_are_refused(main: cat.MainDevice, double: Double) -> None:
    double.ring(1)
    with (
        pytest.raises(cat.errors.ConfigurationError, match=r"port 1 of device 1.*closed ring"),
        clocked_loop(main),
    ):
        pass
    plain = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
    with cat.Loop(plain) as loop:  # without clocks, delays do not matter
        assert next(loop).ok
