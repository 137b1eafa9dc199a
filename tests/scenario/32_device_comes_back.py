"""A tool at the end of the arm is switched off and on, unplugged or replaced while the arm moves.
The tool is optional: the loop continues, and events report the changes.
By policy, the tool returns to OP with its start-up list, and keeps its handle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from catenary.bus import event_types
from catenary.errors import EepromError, MailboxError, StateError, WorkingCounterError
from catenary.model.device import Identity
from catenary.procedure import restore
from catenary.procedure.exchange import Procedure
from catenary.procedure.station import Station
from catenary.types import SINT, UINT, USINT
from catenary.virtual import Coupler, DigitalOutputs, Fault, Servo
from catenary.virtual.faults import (
    exchange,
    leave_state,
    mailbox_silent,
    power_cycle,
    refuse_state,
    swap,
    unplug,
)
from tests.loop_options import grouped
from tests.scenario.cell import OP, PRE_OP, Cell, cell_of

TOOL, GRIPPER = 3, 4


@pytest.fixture
def cell() -> Iterator[Cell]:
    """Yield a cell: a coupler, two servos of the arm, then a servo and lamps of the tool."""
    devices = (
        Coupler(),
        Servo(serial=1),
        Servo(serial=2),
        Servo(name="tool", serial=3),
        DigitalOutputs(serial=4),
    )
    with cell_of(*devices) as cell:
        yield cell


def requests(cell: Cell) -> tuple[cat.Drives, cat.Drives, cat.Outputs]:
    arm = cat.Drives([cell.subs[1], cell.subs[2]], counts_per_turn=2**20, velocity_limit=100.0)
    tool = cat.Drives(
        [cell.subs[TOOL]], counts_per_turn=2**20, velocity_limit=100.0, required=False
    )
    gripper = cat.Outputs(cell.subs[GRIPPER], required=False)
    return arm, tool, gripper


def run(
    cell: Cell,
    *faults: Fault,
    seconds: float = 1.5,
    good: bool = True,
    each: Callable[[cat.Cycle, cat.Drives, cat.Drives, cat.Outputs, cat.Loop], None] | None = None,
    **options: object,
) -> list[event_types.Event]:
    """Move the arm without a missed cycle, and return the events."""
    arm, tool, gripper = requests(cell)
    with cat.Loop(arm, tool, gripper, **grouped(options)) as loop:  # type: ignore[arg-type]
        cell.main.events.get()
        for fault in faults:
            cell.segment.inject(fault)
        home = arm.actual.position.copy()
        for cycle in loop:
            assert cycle.ok or not good
            arm.target.position[:] = home + 0.2 * cycle.time
            assert arm.enabled.all() or not good
            gripper.bits[:] = 1
            if each is not None:
                each(cycle, arm, tool, gripper, loop)
            if cycle.time >= seconds:
                break
        assert abs(arm.actual.position - home - 0.2 * seconds).max() < 0.01
    cell.assert_safe()
    return list(cell.main.events)


def kinds(events: list[event_types.Event]) -> list[tuple[str, int]]:
    """Return the events about devices, without emergencies and without faults found by counters."""
    return [
        (type(e).__name__, e.sub.position)
        for e in events
        if e.sub is not None
        and not isinstance(
            e, event_types.Emergency | event_types.FaultFound | event_types.AxisStopped
        )
    ]


LOST = [("DeviceLost", TOOL), ("DeviceLost", GRIPPER)]
BACK = [("DeviceReturned", TOOL), ("DeviceReturned", GRIPPER)]


def test_a_device_switched_off_and_on_returns_to_op(cell: Cell) -> None:
    states: list[bool] = []

    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 500:
            assert not tool.present.any()
            assert gripper.present == (False,)
            assert cell.subs[TOOL].state is None
        states.append(bool(tool.enabled.all()))
        if cycle.number == 1400:
            assert tool.present.all()
            assert gripper.present == (True,)
            assert cell.states == [OP] * 5
            assert cell.segment[GRIPPER].outputs == 0x0F
            assert (
                cell.segment.core.peek(TOOL, 0x0500, 1) == b"\x01"
            )  # the device has access to its EEPROM
            assert not tool.enabled.any()
            tool.enable()

    events = run(cell, power_cycle(TOOL, at=0.2, for_=0.5), seconds=1.6, each=look)
    assert sorted(kinds(events)) == sorted(LOST + BACK)
    assert states[50]
    assert not any(states[300:1400])
    assert states[-1]


def test_a_returned_drive_moves_only_after_a_request(cell: Cell) -> None:
    """The application enables the drive again, which starts at its actual position."""

    def look(cycle, arm, tool, gripper, loop) -> None:
        tool.target.position[:] = 3.0
        if cycle.number == 1400:
            assert tool.actual.position[0] == pytest.approx(0.0, abs=0.3)
            assert cell.servos[2].drive_state() != "OPERATION ENABLED"

    run(cell, power_cycle(TOOL, at=0.05, for_=0.5), each=look)


def test_the_start_up_list_is_written_again(cell: Cell) -> None:
    """After power-up, the servo has its default mapping and interpolation time.

    The loop requested others. With another mapping, its data would not fit its sync unit.
    """
    tool = cell.subs[TOOL]
    drives = cat.Drives(
        [tool],
        counts_per_turn=2**20,
        velocity_limit=100.0,
        required=False,
        columns=["following_error"],
    )
    gripper = cat.Outputs(cell.subs[GRIPPER], required=False)
    answers = []
    with cat.Loop(drives, gripper, period=4e-3) as loop:
        cell.segment.inject(power_cycle(TOOL, at=0.1, for_=0.4))
        for cycle in loop:
            if cycle.number == 280:
                answers = [
                    tool.sdo.request(0x60C2, 1, type=USINT),
                    tool.sdo.request(0x60C2, 2, type=SINT),
                ]
            if cycle.number == 300:
                break
        assert drives.present.all()
        assert [answer.result() for answer in answers] == [4, -3]


def test_an_unplugged_device_keeps_its_address_and_returns(cell: Cell) -> None:
    events = run(cell, unplug(TOOL, at=0.2, for_=0.5))
    assert sorted(kinds(events)) == sorted(LOST + BACK)
    assert all(sub.state is not None for sub in cell.subs)


@pytest.mark.parametrize(
    "faults",
    [
        [unplug(0, at=0.2, for_=0.5)],
        [power_cycle(position, at=0.2, for_=0.5) for position in range(5)],
    ],
    ids=["unplugged", "switched off"],
)
def test_optional_devices_alone_survive_a_silent_bus(cell: Cell, faults: list[Fault]) -> None:
    """No device is required, so no loss ends the loop, not even that of the coupler."""
    _, tool, gripper = requests(cell)
    with cat.Loop(tool, gripper) as loop:
        cell.main.events.get()
        for fault in faults:
            cell.segment.inject(fault)
        for cycle in loop:
            assert cycle.ok
            if cycle.number == 500:
                assert not tool.present.any()
                assert gripper.present == (False,)
            if cycle.time >= 2.0:
                break
        assert tool.present.all()
        assert gripper.present == (True,)
        assert cell.states == [OP] * 5
    told = kinds(list(cell.main.events))
    assert set(LOST + BACK) <= set(told)


def test_a_loop_can_be_left_while_its_optional_devices_are_silent(cell: Cell) -> None:
    """The devices are still silent when the loop is left."""
    _, tool, gripper = requests(cell)
    with cat.Loop(tool, gripper) as loop:
        cell.segment.inject(unplug(0, at=0.1))
        for cycle in loop:
            if cycle.time >= 0.5:
                break
    assert not tool.present.any()


def test_a_device_is_held_by_policy_until_it_is_released(cell: Cell) -> None:
    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 1000:
            assert cell.states[TOOL:] == [PRE_OP, PRE_OP]
            assert not tool.present.any()
            loop.restore(cell.subs[TOOL])
        if cycle.number == 1400:
            assert cell.states[TOOL:] == [OP, PRE_OP]
            assert tool.present.all()

    events = run(cell, power_cycle(TOOL, at=0.2, for_=0.3), each=look, on_return="hold")
    assert kinds(events)[:2] == LOST
    assert sorted(kinds(events)[2:]) == sorted(
        [*BACK, ("DeviceHeld", TOOL), ("DeviceHeld", GRIPPER)]
    )


def test_a_replacement_is_reported_and_held(cell: Cell) -> None:
    new = Servo(name="tool", serial=99)
    events = run(cell, swap(TOOL, new, at=0.2, for_=0.3))
    [replaced] = [e for e in events if isinstance(e, event_types.DeviceReplaced)]
    assert (replaced.expected.serial, replaced.found.serial) == (3, 99)
    assert ("DeviceReturned", GRIPPER) in kinds(events)
    assert ("DeviceReturned", TOOL) not in kinds(events)


def test_a_device_with_an_unreadable_eeprom_is_not_taken_for_the_former_one(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The device was given the station address, but its identity cannot be read."""
    asked: list[Station] = []

    def unreadable(station: Station) -> Procedure[Identity]:
        asked.append(station)
        yield []
        raise EepromError(f"{station}: EEPROM error")

    monkeypatch.setattr(restore, "identify", unreadable)
    events = run(cell, swap(TOOL, with_=Servo(name="tool", serial=99), at=0.1))
    assert len(asked) > 3  # at every poll
    [held] = [e for e in events if isinstance(e, event_types.DeviceHeld)]
    assert "identity of the device in its place cannot be read" in held.reason
    assert ("DeviceReturned", TOOL) not in kinds(events)
    assert cell.states[TOOL] & 0x0F < PRE_OP


def test_a_replacement_is_accepted_by_policy(cell: Cell) -> None:
    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 1400:
            assert cell.states == [OP] * 5
            assert tool.present.all()

    events = run(
        cell,
        swap(TOOL, Servo(name="tool", serial=99), at=0.2, for_=0.3),
        each=look,
        on_replacement="restore",
    )
    assert any(isinstance(e, event_types.DeviceReplaced) for e in events)
    assert ("DeviceReturned", TOOL) in kinds(events)


def test_an_accepted_replacement_stays_accepted(cell: Cell) -> None:
    """After another power cycle, the device needs no second release."""

    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 600:
            loop.restore(cell.subs[TOOL])
        if cycle.number in (900, 1900):
            assert cell.states == [OP] * 5

    new = Servo(name="tool", serial=99)
    events = run(
        cell,
        swap(TOOL, new, at=0.2, for_=0.3),
        power_cycle(TOOL, at=1.2, for_=0.3),
        seconds=2.0,
        each=look,
    )
    assert sum(isinstance(e, event_types.DeviceReplaced) for e in events) == 1
    assert kinds(events).count(("DeviceReturned", TOOL)) == 2


def test_a_device_held_after_a_refusal_returns_when_released(cell: Cell) -> None:
    """The device was held in any state; here, it had not reached PRE-OP."""

    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 1000:
            assert cell.states[TOOL] & 0x0F != OP
            loop.restore(cell.subs[TOOL])
        if cycle.number == 1400:
            assert cell.states == [OP] * 5

    falls = leave_state(TOOL, at=0.2, state="INIT", code=0x001A)
    refuses = refuse_state(TOOL, at=0.2, for_=0.7, state="PRE-OP", code=0x8000)
    events = run(cell, falls, refuses, each=look)
    assert kinds(events).count(("DeviceHeld", TOOL)) == 1


def test_a_pending_request_does_not_delay_the_return(cell: Cell) -> None:
    """Its mailbox is reset, so the request fails at once, not after two seconds."""
    answers = []

    def look(cycle, arm, tool, gripper, loop) -> None:
        if cell.segment.time >= 0.195 and not answers:
            answers.append(cell.subs[TOOL].sdo.request(0x6041, type=UINT))
        if cycle.number == 600:
            assert cell.states == [OP] * 5
            assert isinstance(answers[0].error, MailboxError)
            assert "restarted before it answered" in str(answers[0].error)

    silent = mailbox_silent(TOOL, at=0.19, for_=0.05)
    run(cell, silent, leave_state(TOOL, at=0.2, state="INIT", code=0x001A), each=look)


def test_another_product_is_never_accepted(cell: Cell) -> None:
    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 1400:
            assert cell.states[TOOL] != OP
            assert cell.states[GRIPPER] == OP
            assert gripper.present == (True,)

    events = run(
        cell,
        swap(TOOL, DigitalOutputs(serial=7), at=0.2, for_=0.3),
        each=look,
        on_replacement="restore",
    )
    [replaced] = [e for e in events if isinstance(e, event_types.DeviceReplaced)]
    assert replaced.found.product != replaced.expected.product


def test_a_device_that_leaves_op_is_brought_back(cell: Cell) -> None:
    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 900:
            assert cell.states == [OP] * 5

    events = run(cell, leave_state(TOOL, at=0.2, state="SAFE-OP", code=0x001B), each=look)
    [lost] = [e for e in events if isinstance(e, event_types.StateLost)]
    assert (lost.sub, lost.state, lost.code) == (cell.subs[TOOL], 4, 0x001B)


def test_the_loss_of_a_required_device_ends_the_loop(cell: Cell) -> None:
    with pytest.raises(WorkingCounterError):
        run(cell, power_cycle(1, at=0.2, for_=0.5), good=False)
    cell.let_pass(1.0)
    assert "OPERATION ENABLED" not in cell.drive_states


def test_a_required_device_that_leaves_op_ends_the_loop_while_another_is_lost(cell: Cell) -> None:
    with pytest.raises(StateError, match="device 2"):
        run(cell, power_cycle(TOOL, at=0.2, for_=0.5), leave_state(2, at=0.9), good=False)
    cell.let_pass(0.5)


def test_two_exchanged_devices_are_both_reported(cell: Cell) -> None:
    """One of the devices belongs to the arm, so the loop ends. The next scan finds both devices."""
    with pytest.raises(WorkingCounterError):
        run(cell, exchange(2, TOOL, at=0.2, for_=0.3), good=False)


@pytest.mark.parametrize("name", ["on_return", "on_replacement"])
def test_an_unknown_policy_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        cat.StopPolicy(**{name: "maybe"})  # type: ignore[arg-type]


def test_objects_of_a_returned_device_can_be_read(cell: Cell) -> None:
    """The handle and its mailbox are the same."""
    answers = []

    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 1300:
            answers.append(cell.subs[TOOL].sdo.request(0x6041, type=UINT))

    run(cell, power_cycle(TOOL, at=0.2, for_=0.3), each=look)
    assert answers[0].done
    assert answers[0].result() & 0x4F


def test_an_internal_error_of_the_watch_is_raised_on_leaving(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No caller waits for its result while the loop runs, so leaving raises it."""

    def broken(at_most: int) -> Procedure[list[restore.Presence]]:
        yield []
        raise ZeroDivisionError(f"of {at_most}")

    monkeypatch.setattr(restore, "find_devices", broken)
    with pytest.raises(ZeroDivisionError):
        run(cell, unplug(TOOL, at=0.1), seconds=0.3)
    assert cell.states[:TOOL] == [PRE_OP] * TOOL
