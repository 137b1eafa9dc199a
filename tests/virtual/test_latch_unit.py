"""Latch unit of the virtual controller, datasheet, section II, 0x09A8 to 0x09CF and 0x0210."""

from __future__ import annotations

import pytest

from catenary.virtual import Coupler, Segment
from tests.virtual.clocks import CYCLIC_UNIT, Clocks

CONTROL, STATUS, RISING, FALLING, EVENTS = 0x09A8, 0x09AE, 0x09B0, 0x09B8, 0x0210
DEVICE = 1
SINGLE = 0x03


@pytest.fixture
def main() -> Clocks:
    return Clocks(Segment([Coupler(), Coupler()]))


def toggle(main: Clocks, *levels: bool, number: int = 0) -> list[int]:
    """Set the input to each level, 1 ms apart. Return the system times."""
    times = []
    for level in levels:
        times.append(main.segment.core.system_time(DEVICE))
        main.segment[DEVICE].set_latch_input(number, level)
        main.let_pass(1)
    return times


def test_single_event_mode_keeps_the_first_edge(main: Clocks) -> None:
    main.put_number(DEVICE, CONTROL, "<B", SINGLE)
    first, down, *_ = toggle(main, True, False, True)
    assert main.number(DEVICE, STATUS, "<B") == 0x07
    assert main.number(DEVICE, EVENTS, "<H") & 1
    assert main.number(DEVICE, RISING, "<Q") == first
    assert main.number(DEVICE, STATUS, "<B") == 0x06  # acknowledged by reading
    assert main.number(DEVICE, FALLING, "<Q") == down
    assert main.number(DEVICE, STATUS, "<B") == 0x04
    assert not main.number(DEVICE, EVENTS, "<H") & 1


def test_continuous_mode_keeps_the_last_edge(main: Clocks) -> None:
    *_, last = toggle(main, True, False, True)
    assert main.number(DEVICE, STATUS, "<B") == 0x04
    assert main.number(DEVICE, RISING, "<Q") == last


def test_the_inputs_are_independent(main: Clocks) -> None:
    [time] = toggle(main, True, number=1)
    assert main.number(DEVICE, STATUS, "<B") == 0
    assert main.number(DEVICE, RISING, "<Q") == 0
    assert main.number(DEVICE, RISING + 16, "<Q") == time


def test_a_unit_of_the_application_ignores_frames(main: Clocks) -> None:
    main.put_number(DEVICE, CONTROL, "<B", SINGLE)
    main.put_number(DEVICE, CYCLIC_UNIT, "<B", 0x10)
    main.put_number(DEVICE, CONTROL, "<B", 0)
    assert main.number(DEVICE, CONTROL, "<B") == SINGLE
    toggle(main, True)
    main.number(DEVICE, RISING, "<Q")
    assert main.number(DEVICE, STATUS, "<B") == 0x05  # not acknowledged


def test_an_input_that_does_not_exist(main: Clocks) -> None:
    with pytest.raises(IndexError, match="0 or 1"):
        main.segment[DEVICE].set_latch_input(2, True)
