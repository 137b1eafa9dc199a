"""Clocks in a ring. In a closed ring no frame comes back through the ports it left by, so nothing
tells how long its cables are: for the moment of the measurement the ring is a line. The SYNC pulses
of its drives then coincide as those of a line do; a ring that is cut says so instead."""

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
    run_for(loop, 16.0)  # four times what the controllers' own filters take
    found = true_differences(segment)
    assert len(found) == COUNT - 1
    assert max(map(abs, found.values())) < 50e-9


def test_its_clocks_come_together_as_those_of_a_line(
    segment: Segment, main: cat.MainDevice
) -> None:
    with cat.Loop(drives(main)) as loop:
        assert_together(segment, loop)
        assert loop.timing.counters["lost"] == 0
    assert main.clock_delays_ns[-1] == pytest.approx(1560, abs=50)


def test_the_ring_is_closed_again_behind_the_measurement(
    segment: Segment, main: cat.MainDevice
) -> None:
    """A cut costs nothing afterwards: frames go round by both ends."""
    with cat.Loop(drives(main)) as loop:
        for cycle in loop:
            assert cycle.ok
            if cycle.number == 20:
                segment.inject(cut(between=(1, 2), at=0))
            if cycle.number == 200:
                break


def test_cut_at_its_second_end_it_is_a_line(segment: Segment, main: cat.MainDevice) -> None:
    segment.inject(cut(between=LAST_CABLE, at=0))
    with cat.Loop(drives(main)) as loop:
        assert_together(segment, loop)


@pytest.mark.parametrize("cable", [("main", 0), (1, 2)])
def test_a_cut_ring_has_no_common_time(
    segment: Segment, main: cat.MainDevice, cable: tuple[int | str, int | str]
) -> None:
    segment.inject(cut(between=cable, at=0))
    arm = drives(main)
    with pytest.raises(ClockError, match="the ring is cut between"), cat.Loop(arm):
        raise AssertionError("it opened")
    assert all(device.state & 0x0F <= 2 for device in segment)


@pytest.mark.parametrize("cable", [(1, 2), LAST_CABLE])
def test_mended_since_the_scan_it_is_scanned_again(
    segment: Segment, main: cat.MainDevice, cable: tuple[int | str, int | str]
) -> None:
    """What was read of the ports tells no more where the second end is."""
    segment.inject(cut(between=cable, at=0))
    arm = drives(main)
    segment.inject(join(between=cable, at=0))
    with pytest.raises(ClockError, match="scan again"), cat.Loop(arm):
        raise AssertionError("it opened")
    with cat.Loop(drives(main)) as loop:
        assert_together(segment, loop)


@pytest.mark.parametrize("cable", [("main", 0), (1, 2), (3, 4)])
def test_behind_a_cut_they_are_led_by_the_time_that_is_expected(
    cable: tuple[int | str, int | str],
) -> None:
    """Not as well as by the reference clock, but no SYNC pulse runs away from the frames."""
    segment = segment_of(jitter=0.2e-6)
    with cat.MainDevice(segment.first, segment.second) as main, cat.Loop(drives(main)) as loop:
        loop.wait_locked(within=1e-6, timeout=2.0)
        run_for(loop, 2.0)
        segment.inject(cut(between=cable, at=0))
        for _ in range(30):
            run_for(loop, 2.0)
            assert max(map(abs, true_differences(segment).values())) < 5e-6
            assert not loop.clocks.locked  # nothing on the bus compares them with the reference
        segment.inject(join(between=cable, at=0))
        run_for(loop, 5.0)
        assert loop.clocks.locked
        assert max(map(abs, true_differences(segment).values())) < 1e-6
    told = [e for e in main.events if isinstance(e, ClockLocked | ClockUnlocked)]
    assert [type(e) for e in told] == [ClockLocked, ClockUnlocked, ClockLocked]
    assert "the ring is cut" in told[1].message


def test_cut_behind_the_last_clock_they_are_together(
    segment: Segment, main: cat.MainDevice
) -> None:
    with cat.Loop(drives(main)) as loop:
        loop.wait_locked(within=1e-6, timeout=2.0)
        segment.inject(cut(between=LAST_CABLE, at=0))
        run_for(loop, 1.0)
        assert loop.clocks.locked
