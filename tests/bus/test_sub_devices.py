"""Devices by kind and by alias."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.errors import SegmentError
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo


def positions(subs: tuple[cat.SubDevice, ...]) -> list[int]:
    return [sub.position for sub in subs]


def test_a_group_goes_up_to_the_next_alias() -> None:
    devices = [Coupler(), Servo(alias=10), DigitalOutputs(), Servo(), Coupler(alias=20), Servo()]
    with cat.MainDevice(Segment(devices)) as main:
        subs = main.scan()
        assert positions(subs.group(10)) == [1, 2, 3]
        assert positions(subs.group(20)) == [4, 5]
        assert subs.group(30) == ()
        assert positions(subs.drives) == [1, 3, 5]
        with pytest.raises(ValueError, match="0 is none"):
            subs.group(0)


def test_an_alias_that_two_have_is_refused_when_it_is_asked_for() -> None:
    with cat.MainDevice(Segment([Servo(alias=7), Servo(alias=7)])) as main:
        subs = main.scan()
        with pytest.raises(SegmentError, match="devices 0, 1 have the same alias 7"):
            subs.group(7)
