"""Rings on the virtual segment, from the view of the MainDevice."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, SegmentError
from catenary.link import Interface
from catenary.virtual import Coupler, Segment, Servo


@pytest.mark.parametrize("ask", [cat.MainDevice.scan, cat.MainDevice.passive_scan])
def test_swapped_ports_are_an_error(ask: Callable[[cat.MainDevice], object]) -> None:
    """Frames of the first port then pass all devices unprocessed, so positions match no device."""
    segment = Segment([Coupler(), Servo()], ring=True)
    with (
        cat.MainDevice(segment.second, segment.first) as main,
        pytest.raises(SegmentError, match="wrong direction") as caught,
    ):
        ask(main)
    assert "swap the two cables" in caught.value.hint


def test_a_ring_needs_two_ports() -> None:
    with pytest.raises(ConfigurationError, match="two different ports"):
        cat.MainDevice("eth9", "eth9")
    with pytest.raises(ConfigurationError, match="eth9"):
        cat.MainDevice(Interface("eth9"), "eth9")
