"""A cable of a ring is pulled and plugged in at any time while all axes move. The only lost cycles
are those with frames in flight, or sent before the controllers detected the dead cable.
Events name the devices at its ends. With two cuts, the devices between them are unreachable.
"""

from __future__ import annotations

import random

import pytest

import catenary as cat
from catenary.bus import event_types
from catenary.errors import WorkingCounterError
from catenary.virtual import Coupler, Segment, Servo
from catenary.virtual.faults import cut, join, power_cycle

COUNT = 6  # devices; the servos are 1 to 5
CABLES = [(None, 0), *((k, k + 1) for k in range(COUNT - 1)), (COUNT - 1, None)]


def segment_of(*faults: object, detection: str = "enhanced") -> Segment:
    devices = [Coupler(), *(Servo(serial=k) for k in range(1, COUNT))]
    return Segment(devices, ring=True, faults=faults, link_loss_detection=detection)  # type: ignore[arg-type]


@pytest.fixture
def segment() -> Segment:
    return segment_of()


def cable_of(between: tuple[int | None, int | None]) -> tuple[int | str, int | str]:
    """Return the ends of a cable as the segment names them."""
    first, second = between
    return ("main" if first is None else first, "main" if second is None else second)


@pytest.mark.parametrize("between", CABLES)
def test_any_cable_may_be_pulled_and_plugged_in(
    segment: Segment, between: tuple[int | None, int | None]
) -> None:
    with cat.MainDevice(segment.first, segment.second) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                assert cycle.ok
                arm.target.position[:] = home + 0.1 * cycle.time
                if cycle.number == 50:  # the frames of this cycle are back
                    segment.inject(cut(between=cable_of(between), at=0))
                if cycle.number == 150:
                    segment.inject(join(between=cable_of(between), at=0))
                if cycle.number == 250:
                    break
            assert loop.timing.counters["lost"] == 0
        told = [
            e for e in main.events if isinstance(e, event_types.LinkLost | event_types.LinkRestored)
        ]
        assert [(type(e), e.between) for e in told] == [
            (event_types.LinkLost, between),
            (event_types.LinkRestored, between),
        ]


@pytest.mark.parametrize("between", CABLES)
def test_a_loop_starts_with_any_cable_missing(between: tuple[int | None, int | None]) -> None:
    segment = segment_of(cut(between=cable_of(between), at=0))
    with cat.MainDevice(segment.first, segment.second) as main:
        subs = main.scan()
        assert [sub.identity.serial for sub in subs][1:] == [1, 2, 3, 4, 5]
        assert any("the ring is cut" in note for note in main.notes)
        arm = cat.Drives(subs.drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm) as loop:
            for cycle in loop:
                assert cycle.ok
                if cycle.number == 20:
                    segment.inject(join(between=cable_of(between), at=0))
                if cycle.number == 60:
                    break


def test_two_cuts_that_isolate_required_devices_end_the_loop(segment: Segment) -> None:
    with cat.MainDevice(segment.first, segment.second) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with pytest.raises(WorkingCounterError, match="device 3") as caught, cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 50:
                    segment.inject(cut(between=(2, 3), at=0))
                    segment.inject(cut(between=(4, 5), at=0.0))
                if cycle.number == 100:
                    break
        assert "device 2" not in caught.value.message
        assert "device 5" not in caught.value.message
    assert [segment[k].state & 0x0F for k in (0, 1, 2, 5)] == [1, 1, 1, 1]
    segment.first.open_link().wait_until(segment.now_ns + 500_000_000, False)
    assert "OPERATION ENABLED" not in [segment[k].drive_state() for k in range(1, COUNT)]


def test_optional_devices_isolated_by_two_cuts_are_named_and_return(
    segment: Segment,
) -> None:
    with cat.MainDevice(segment.first, segment.second) as main:
        subs = main.scan()
        arm = cat.Drives([subs[1], subs[2], subs[5]], counts_per_turn=2**20, velocity_limit=100.0)
        others = cat.Drives(
            [subs[3], subs[4]], counts_per_turn=2**20, velocity_limit=100.0, required=False
        )
        with cat.Loop(arm, others) as loop:
            for cycle in loop:
                assert cycle.ok
                if cycle.number == 50:
                    segment.inject(cut(between=(2, 3), at=0))
                    segment.inject(cut(between=(4, 5), at=0))
                if cycle.number == 300:
                    assert not others.present.any()
                    segment.inject(join(between=(2, 3), at=0))
                    segment.inject(join(between=(4, 5), at=0))
                if cycle.number == 900:
                    assert others.present.all()
                    break
        lost = [e for e in main.events if isinstance(e, event_types.LinkLost)]
    assert [e.between for e in lost] == [(2, 3), (4, 5)]
    assert all("devices 3 to 4 are unreachable" in e.message for e in lost)


def test_a_device_before_a_cut_returns_after_power_off(segment: Segment) -> None:
    """Positions count from the first port, so devices after the cut have no position there."""
    with cat.MainDevice(segment.first, segment.second) as main:
        subs = main.scan()
        arm = cat.Drives([subs[k] for k in (1, 2, 5)], counts_per_turn=2**20, velocity_limit=100.0)
        others = cat.Drives(
            [subs[3], subs[4]], counts_per_turn=2**20, velocity_limit=100.0, required=False
        )
        with cat.Loop(arm, others) as loop:
            for cycle in loop:
                assert cycle.ok
                if cycle.number == 50:
                    segment.inject(cut(between=(4, 5), at=0))
                if cycle.number == 100:
                    segment.inject(power_cycle(3, at=0, for_=0.3))
                if cycle.number == 1500:
                    assert others.present.all()
                    break


@pytest.mark.parametrize(("detection", "at_most"), [("enhanced", 1), ("standard", 5)])
def test_a_thousand_cuts_lose_only_unavoidable_frames(detection: str, at_most: int) -> None:
    """The cuts are at random times, even within frames.

    Every lost cycle has a frame that was in flight, or was sent before the dead cable was detected.
    """
    chance = random.Random(7)
    segment = segment_of(detection=detection)
    with cat.MainDevice(segment.first, segment.second) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, stop=cat.StopPolicy(lost_limit=20)) as loop:
            changes, cutting, between, longest, lost = 0, True, CABLES[0], 0, 0
            for cycle in loop:
                declared = segment.take_losses()
                if not cycle.ok:
                    assert declared
                    lost += 1
                    longest = max(longest, cycle.lost)
                if cycle.number % 12 == 0 and changes < 1000:
                    between = chance.choice(CABLES) if cutting else between
                    fault = cut if cutting else join
                    moment = segment.time + chance.uniform(0, 2e-3)
                    segment.inject(fault(between=cable_of(between), at=moment))
                    cutting = not cutting
                    changes += 1
                if changes == 1000 and cycle.number % 12 == 11:
                    break
    print(f"{detection}: 1000 cuts and joins, {lost} cycles lost, at most {longest} consecutive")
    assert longest <= at_most
