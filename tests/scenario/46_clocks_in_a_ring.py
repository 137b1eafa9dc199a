"""In a closed ring, no frame returns through the ports it left by, so delays cannot be measured.
The ring is opened for the measurement. The SYNC pulses then coincide as in a line.
In a cut ring, clocks are refused with an error.
"""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

import catenary as cat
from catenary.bus.event_types import ClockLocked, ClockUnlocked
from catenary.errors import ClockError
from catenary.virtual import Coupler, Segment, Servo
from catenary.virtual.faults import cut, join
from tests.scenario.clocked import crystal, run_for, true_differences

COUNT = 5
LAST_CABLE = (COUNT - 1, "main")


@pytest.fixture
def segment() -> Segment:
    return segment_of(jitter=0.0)


def segment_of(jitter: float) -> Segment:
    random = Random(3)
    servos = [Servo(serial=k, crystal=crystal(random, jitter)) for k in range(1, COUNT)]
    return Segment([Coupler(crystal=crystal(random, jitter)), *servos], ring=True)


@pytest.fixture
def main(segment: Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment.first, segment.second) as main:
        yield main


def drives(main: cat.MainDevice) -> cat.Drives:
    return cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0, dc=True)


def assert_together(segment: Segment, loop: cat.Loop) -> None:
    loop.wait_locked(within=1e-6, timeout=2.0)
    run_for(loop, 16.0)  # four times the settling time of the controllers' filters
    found = true_differences(segment)
    assert len(found) == COUNT - 1
    assert max(map(abs, found.values())) < 50e-9


def test_clocks_of_a_ring_synchronise_as_in_a_line(segment: Segment, main: cat.MainDevice) -> None:
    with cat.Loop(drives(main)) as loop:
        assert_together(segment, loop)
        assert loop.timing.counters["lost"] == 0
    assert main.clock_delays_ns[-1] == pytest.approx(1560, abs=50)


def test_the_ring_is_closed_after_the_measurement(segment: Segment, main: cat.MainDevice) -> None:
    """A later cut loses no data, because frames reach all devices from both ends."""
    with cat.Loop(drives(main)) as loop:
        for cycle in loop:
            assert cycle.ok
            if cycle.number == 20:
                segment.inject(cut(between=(1, 2), at=0))
            if cycle.number == 200:
                break


def test_a_ring_cut_at_its_second_end_works_as_a_line(
    segment: Segment, main: cat.MainDevice
) -> None:
    segment.inject(cut(between=LAST_CABLE, at=0))
    with cat.Loop(drives(main)) as loop:
        assert_together(segment, loop)


@pytest.mark.parametrize("cable", [("main", 0), (1, 2)])
def test_clocks_in_a_cut_ring_are_refused(
    segment: Segment, main: cat.MainDevice, cable: tuple[int | str, int | str]
) -> None:
    segment.inject(cut(between=cable, at=0))
    arm = drives(main)
    with pytest.raises(ClockError, match="the ring is cut between"), cat.Loop(arm):
        raise AssertionError("the loop was opened")
    assert all(device.state & 0x0F <= 2 for device in segment)


@pytest.mark.parametrize("cable", [(1, 2), LAST_CABLE])
def test_a_ring_repaired_after_the_scan_needs_a_new_scan(
    segment: Segment, main: cat.MainDevice, cable: tuple[int | str, int | str]
) -> None:
    """The port states of the scan no longer show the second end."""
    segment.inject(cut(between=cable, at=0))
    arm = drives(main)
    segment.inject(join(between=cable, at=0))
    with pytest.raises(ClockError, match="scan again"), cat.Loop(arm):
        raise AssertionError("the loop was opened")
    with cat.Loop(drives(main)) as loop:
        assert_together(segment, loop)


@pytest.mark.parametrize("cable", [("main", 0), (1, 2), (3, 4)])
def test_clocks_after_a_cut_follow_the_expected_time(
    cable: tuple[int | str, int | str],
) -> None:
    """They are less accurate than with the reference clock, but pulses stay after the frames."""
    segment = segment_of(jitter=0.2e-6)
    with cat.MainDevice(segment.first, segment.second) as main, cat.Loop(drives(main)) as loop:
        loop.wait_locked(within=1e-6, timeout=2.0)
        run_for(loop, 2.0)
        segment.inject(cut(between=cable, at=0))
        for _ in range(30):
            run_for(loop, 2.0)
            assert max(map(abs, true_differences(segment).values())) < 5e-6
            assert not loop.clocks.locked  # they cannot be compared with the reference
        segment.inject(join(between=cable, at=0))
        run_for(loop, 5.0)
        assert loop.clocks.locked
        assert max(map(abs, true_differences(segment).values())) < 1e-6
    told = [e for e in main.events if isinstance(e, ClockLocked | ClockUnlocked)]
    assert [type(e) for e in told] == [ClockLocked, ClockUnlocked, ClockLocked]
    assert "the ring is cut" in told[1].message


def test_clocks_stay_synchronised_if_the_cut_is_after_the_last_clock(
    segment: Segment, main: cat.MainDevice
) -> None:
    with cat.Loop(drives(main)) as loop:
        loop.wait_locked(within=1e-6, timeout=2.0)
        segment.inject(cut(between=LAST_CABLE, at=0))
        run_for(loop, 1.0)
        assert loop.clocks.locked
