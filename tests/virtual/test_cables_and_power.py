"""Cables and power of a virtual segment, changed by a program instead of a fault."""

from __future__ import annotations

from contextlib import suppress

import pytest

import catenary as cat
from catenary.errors import SegmentError
from catenary.virtual import Segment
from catenary.virtual.devices import Coupler, Servo


def test_a_pulled_cable_hides_the_devices_after_it() -> None:
    segment = Segment([Coupler(), Servo(), Servo()])
    segment.plug_port(1, 1, False)
    with cat.MainDevice(segment) as main:
        assert len(main.scan()) == 2
        segment.plug_port(2, 0, True)  # the other end of the same cable
        for _ in range(100):
            if len(main.scan()) == 3:
                break
        assert len(main.subs) == 3


def test_a_device_without_power_does_not_answer() -> None:
    segment = Segment([Coupler(), Servo(), Servo()])
    segment.switch_power(2, False)
    with cat.MainDevice(segment) as main:
        assert len(main.scan()) == 2
        segment.switch_power(2, True)
        for _ in range(100):
            with suppress(SegmentError):  # the device appears during this scan
                if len(main.scan()) == 3:
                    break
        assert len(main.subs) == 3


@pytest.mark.parametrize(("device", "port"), [(2, 1), (0, 3), (7, 0), (-1, 0)])
def test_a_port_without_a_cable_is_refused(device: int, port: int) -> None:
    with pytest.raises(ValueError, match="no cable"):
        Segment([Coupler(), Servo(), Servo()]).plug_port(device, port, False)


def test_an_unknown_device_is_refused() -> None:
    with pytest.raises(ValueError, match="no device 5"):
        Segment([Servo()]).switch_power(5, False)
