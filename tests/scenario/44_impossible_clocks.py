"""Clocks are requested of devices without clocks, or of devices before the reference.
The request is refused before anything moves, and the error names the device.
Frames that do not fit before SYNC0 are refused, too.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from tests.loop_options import grouped
from tests.scenario.cell import PRE_OP, Cell


def enter(cell: Cell, *requests: object, **options: object) -> None:
    with cat.Loop(*requests, period=1e-3, **grouped(options)):  # type: ignore[arg-type]
        raise AssertionError("the loop was opened")


def test_a_device_without_a_clock_is_refused(cell: Cell) -> None:
    lamps = cat.Outputs(cell.subs[1], dc=True)
    with pytest.raises(ConfigurationError, match=r"device 1 .*dc= was requested, but it has no"):
        enter(cell, cell.drives(dc=True), lamps)
    assert all(state == PRE_OP for state in cell.states)


def test_a_reference_without_a_clock_is_refused(cell: Cell) -> None:
    with pytest.raises(ConfigurationError, match=r"device 1 .*given as the reference clock"):
        enter(cell, cell.drives(dc=True), reference=cell.subs[1])


def test_a_reference_after_its_followers_is_refused(cell: Cell) -> None:
    with pytest.raises(ConfigurationError, match=r"device 2 .* precedes device 3"):
        enter(cell, cell.drives(dc=True), reference=cell.subs[3])


def test_frames_that_do_not_fit_before_sync0_are_refused(cell: Cell) -> None:
    with pytest.raises(ConfigurationError, match="do not fit into a period of 1000 us"):
        enter(cell, cell.drives(dc=True), margin=0.99e-3)


def test_contradicting_requests_are_refused(cell: Cell) -> None:
    one = cat.Drives(
        cell.subs.drives,
        counts_per_turn=2**20,
        velocity_limit=100.0,
        dc=cat.DistributedClock(shift=1e-4),
    )
    other = cat.Inputs(cell.subs[2], dc=True)
    with pytest.raises(ConfigurationError, match=r"device 2: two requests"):
        enter(cell, one, other)


def test_the_user_can_choose_the_reference(cell: Cell) -> None:
    with cat.Loop(
        cell.drives(dc=True), period=1e-3, clocks=cat.ClockOptions(reference=cell.subs[2])
    ) as loop:
        loop.wait_locked()
        assert loop.clocks.reference is cell.subs[2]
        assert set(loop.clocks.differences) == {3}


def test_unknown_clocks_to_follow_are_refused(cell: Cell) -> None:
    with pytest.raises(ValueError, match='lead=\'gps\': must be one of "reference", "main"'):
        cat.Loop(cell.drives(dc=True), clocks=cat.ClockOptions(lead="gps"))  # type: ignore[arg-type]
