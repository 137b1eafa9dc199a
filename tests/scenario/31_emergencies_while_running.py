"""A drive sends an emergency while the loop runs, and nobody has asked it anything.
A bit in the cycle says that its mailbox is full; where no FMMU was left for it, the register does.
It becomes an event with its text; the cycle goes on, and so does a conversation with that drive.
"""

from collections.abc import Iterator
from dataclasses import replace

import pytest

import catenary as cat
from catenary.bus import SubDevice
from catenary.bus.event_types import AxisStopped, Emergency, Event
from catenary.types import UDINT
from tests.scenario.cell import Cell


def with_fmmus(sub: SubDevice, count: int) -> None:
    """As if its controller had no more."""
    controller = replace(sub.description.controller, fmmu_count=count)
    sub.description = replace(sub.description, controller=controller)


def emergencies(loop: cat.Loop, cell: Cell, cycles: int) -> Iterator[tuple[int, Emergency]]:
    for cycle in loop:
        if cycle.number == 20:
            cell.servos[1].inject_fault(0x7305)
        for event in cell.main.events:
            if isinstance(event, AxisStopped):
                continue  # the core's part: tests/scenario/07_fault.py
            assert isinstance(event, Emergency)
            yield cycle.number, event
        if cycle.number == cycles:
            return


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_the_bit_in_the_cycle_tells_at_once(cell: Cell, run: str) -> None:
    arm = cell.drives()
    with cat.Loop(arm, execution=run, stop=cat.StopPolicy(raise_faults=False)) as loop:  # type: ignore[arg-type]
        assert loop.plan.mailboxes.devices == (2, 3)
        sent = loop.timing.counters["acyclic_sent"]
        [(when, event)] = emergencies(loop, cell, cycles=60)
        assert loop.timing.counters["lost"] == 0
        assert loop.timing.counters["acyclic_sent"] - sent < 10
    assert 20 < when <= 28
    assert event.sub is cell.subs[3]
    assert (event.error_code, event.text) == (0x7305, "incremental sensor 1 fault")
    assert "device 3" in event.message
    cell.assert_safe()


def test_without_an_fmmu_to_spare_the_register_is_asked(cell: Cell) -> None:
    for drive in cell.subs.drives:
        with_fmmus(drive, 2)
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        assert loop.plan.mailboxes.devices == ()
        [(when, event)] = emergencies(loop, cell, cycles=100)
        assert loop.timing.counters["lost"] == 0
    assert when <= 50  # two devices in turn, 10 ms each
    assert event.sub is cell.subs[3]


def test_one_with_and_one_without(cell: Cell) -> None:
    with_fmmus(cell.subs[2], 2)
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        assert loop.plan.mailboxes.devices == (3,)
        [(when, _)] = emergencies(loop, cell, cycles=60)
    assert when <= 28


def test_a_conversation_with_the_drive_hears_it_too(cell: Cell) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[1]
    answers = []
    told: list[Event] = []
    cell.main.on_event(told.append)
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        for cycle in loop:
            if cycle.number == 20:
                cell.servos[1].inject_fault(0x7305)
            if not answers or answers[-1].done:
                answers.append(drive.sdo.request(0x1018, 1, type=UDINT))
            if cycle.number == 100:
                break
    assert [event.message for event in told] == [event.message for event in cell.main.events]
    assert [type(event) for event in told] == [AxisStopped, Emergency]
    assert {answer.result() for answer in answers[:-1]} == {drive.identity.vendor}
    assert len(answers) > 15


def test_nothing_is_asked_where_nothing_is_said(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 0:
                sent = loop.timing.counters["acyclic_sent"]
            if cycle.number == 1000:
                break
        assert loop.timing.counters["acyclic_sent"] - sent <= 11  # a register each 100 ms
