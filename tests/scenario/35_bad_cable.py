"""A cable corrupts every twentieth frame while the drives move. The loop continues, and one event
names the cable within two seconds. If the cable corrupts every frame, the final error names it.
A device that answers without process data is named, too.
"""

import pytest

import catenary as cat
from catenary.bus.event_types import FaultFound
from catenary.errors import WorkingCounterError
from catenary.model.finding import Kind
from catenary.model.topology import Cable
from catenary.virtual.faults import corrupt, cut, wrong_working_counter
from tests.scenario.cell import Cell


def found(cell: Cell) -> list[FaultFound]:
    return [event for event in cell.main.events if isinstance(event, FaultFound)]


def test_a_cable_that_corrupts_some_frames_is_named_while_the_loop_continues(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm, period=1e-3) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 0.1 * cycle.time
            if cycle.number == 500:
                cell.segment.inject(corrupt(1000, every=20, between=(1, 2)))
            if cycle.number == 500 + 2000:
                named = found(cell)
            if cycle.number == 10_000:
                break
        assert loop.timing.counters["lost"] > 400
    [event] = named
    assert event.finding.kind is Kind.CABLE
    assert event.finding.cable == Cable(1, 1, 2)
    assert event.sub is cell.subs[2]
    assert found(cell) == []
    cell.assert_safe()


def test_a_cable_that_corrupts_every_frame_is_named_by_the_error(cell: Cell) -> None:
    with pytest.raises(WorkingCounterError) as caught, cat.Loop(cell.drives()) as loop:
        for cycle in loop:
            if cycle.number == 1500:
                cell.segment.inject(corrupt(40, between=(1, 2)))
            assert cycle.number < 1600
    assert "the cable between device 1" in str(caught.value)
    assert "broken frames at device 2" in str(caught.value)


def test_a_loose_plug_is_named(cell: Cell) -> None:
    with cat.Loop(cell.drives(), stop=cat.StopPolicy(lost_limit=20)) as loop:
        for cycle in loop:
            if cycle.number == 1500:
                cell.segment.inject(cut(between=(2, 3), for_=0.005))
            if cycle.number == 3600:
                break
    [event] = found(cell)
    assert event.finding.cable == Cable(2, 1, 3)
    assert "1 lost link" in event.message


def test_a_sound_segment_produces_no_events(cell: Cell) -> None:
    with cat.Loop(cell.drives()) as loop:
        for cycle in loop:
            if cycle.number == 3000:
                break
    assert found(cell) == []


def test_a_device_that_ignores_process_data_is_named(cell: Cell) -> None:
    with pytest.raises(WorkingCounterError) as caught, cat.Loop(cell.drives()) as loop:
        for cycle in loop:
            if cycle.number == 100:
                cell.segment.inject(wrong_working_counter(2))
            assert cycle.number < 150
    assert f"in OP, but without process data: {cell.subs[2].station}" in str(caught.value)
    assert str(cell.subs[3].station) not in str(caught.value)
