"""Delays that cannot be right: clocks are refused."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.igh import Master
from tests.igh.double import Double


@pytest.fixture
def main(double: Double) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        yield main


def loop_of(main: cat.MainDevice) -> cat.Loop:
    return cat.Loop(
        cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0, dc=True)
    )


@pytest.mark.parametrize("delay", [2_147_000_000, 5_000_000])
def test_delays_that_cannot_be_are_refused(
    main: cat.MainDevice, double: Double, delay: int
) -> None:
    """A closed ring makes them: the clocks would agree with each other on a wrong time."""
    double.measured(delay)
    with pytest.raises(cat.errors.ConfigurationError, match="us from device 0"), loop_of(main):
        pass
    assert "activate" not in double.calls()
    double.measured(0)
    with loop_of(main) as loop:
        assert next(loop).ok


def test_clocks_in_a_closed_ring_are_refused(main: cat.MainDevice, double: Double) -> None:
    double.ring(1)
    with (
        pytest.raises(cat.errors.ConfigurationError, match=r"port 1 of device 1.*closed ring"),
        loop_of(main),
    ):
        pass
    plain = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
    with cat.Loop(plain) as loop:  # without clocks there are no delays to be wrong
        assert next(loop).ok
