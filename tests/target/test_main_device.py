"""The public MainDevice: names and link sources."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.virtual import Coupler, Segment


def test_two_virtual_segments_are_not_a_ring() -> None:
    with pytest.raises(ConfigurationError, match="cannot be one end of a ring") as caught:
        cat.MainDevice(Segment([Coupler()]), Segment([Coupler()]))
    assert "segment.first" in str(caught.value)


def test_the_ends_of_a_virtual_ring_are() -> None:
    segment = Segment([Coupler(), Coupler()], ring=True)
    with cat.MainDevice(segment.first, segment.second) as main:
        assert len(main.scan()) == 2
