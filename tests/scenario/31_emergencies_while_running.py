"""A drive sends an emergency while the loop runs, without a request.
A bit in the cycle shows a full mailbox; without a free FMMU, a register is polled instead.
The emergency becomes an event with a text. The cycle and other mailbox transfers continue.
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
    """Limit the number of FMMUs of a controller."""
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
def test_the_mailbox_bit_in_the_cycle_reports_at_once(cell: Cell, run: str) -> None:
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


def test_without_a_free_fmmu_the_register_is_polled(cell: Cell) -> None:
    for drive in cell.subs.drives:
        with_fmmus(drive, 2)
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        assert loop.plan.mailboxes.devices == ()
        [(when, event)] = emergencies(loop, cell, cycles=100)
        assert loop.timing.counters["lost"] == 0
    assert when <= 50  # two devices in turn, 10 ms each
    assert event.sub is cell.subs[3]


def test_one_device_with_and_one_without_a_free_fmmu(cell: Cell) -> None:
    with_fmmus(cell.subs[2], 2)
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        assert loop.plan.mailboxes.devices == (3,)
        [(when, _)] = emergencies(loop, cell, cycles=60)
    assert when <= 28


def test_an_emergency_during_a_transfer_is_reported(cell: Cell) -> None:
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


def test_without_emergencies_registers_are_polled_rarely(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 0:
                sent = loop.timing.counters["acyclic_sent"]
            if cycle.number == 1000:
                break
        assert loop.timing.counters["acyclic_sent"] - sent <= 11  # one register per 100 ms
