"""A tool at the end of the arm is switched off and on again, unplugged, exchanged, while the arm
moves on. Nobody requires it: the loop goes on, events say what happened, and by policy it is led
back to OP with its start-up list replayed. Its handle stays the same.
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
    """A coupler, two servos of the arm, a servo and lamps of the tool behind them."""
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
    """The arm moves throughout and never misses a cycle; what happened meanwhile."""
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
    """What was told of devices; what they told themselves, and what the error counters say of
    their cables and power, are other scenarios."""
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


def test_switched_off_and_on_it_is_led_back(cell: Cell) -> None:
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
            assert cell.segment.core.peek(TOOL, 0x0500, 1) == b"\x01"  # the EEPROM is its own
            assert not tool.enabled.any()
            tool.enable()

    events = run(cell, power_cycle(TOOL, at=0.2, for_=0.5), seconds=1.6, each=look)
    assert sorted(kinds(events)) == sorted(LOST + BACK)
    assert states[50]
    assert not any(states[300:1400])
    assert states[-1]


def test_nothing_moves_by_itself_when_it_is_back(cell: Cell) -> None:
    """The application asks again, and it starts from where it stands."""

    def look(cycle, arm, tool, gripper, loop) -> None:
        tool.target.position[:] = 3.0
        if cycle.number == 1400:
            assert tool.actual.position[0] == pytest.approx(0.0, abs=0.3)
            assert cell.servos[2].drive_state() != "OPERATION ENABLED"

    run(cell, power_cycle(TOOL, at=0.05, for_=0.5), each=look)


def test_what_was_mapped_and_written_at_the_start_is_replayed(cell: Cell) -> None:
    """After power-up the servo has its default mapping and interpolation time; the loop asked for
    others. With another mapping its answers would not fit its sync unit."""
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


def test_unplugged_it_keeps_its_address_and_comes_back_all_the_same(cell: Cell) -> None:
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
    """No device is required, so none is missing: not even the coupler before them."""
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


def test_optional_devices_alone_may_be_left_behind(cell: Cell) -> None:
    """The devices are still silent when the loop is left."""
    _, tool, gripper = requests(cell)
    with cat.Loop(tool, gripper) as loop:
        cell.segment.inject(unplug(0, at=0.1))
        for cycle in loop:
            if cycle.time >= 0.5:
                break
    assert not tool.present.any()


def test_held_by_policy_until_it_is_released(cell: Cell) -> None:
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


def test_another_one_of_its_kind_is_told_and_held(cell: Cell) -> None:
    new = Servo(name="tool", serial=99)
    events = run(cell, swap(TOOL, new, at=0.2, for_=0.3))
    [replaced] = [e for e in events if isinstance(e, event_types.DeviceReplaced)]
    assert (replaced.expected.serial, replaced.found.serial) == (3, 99)
    assert ("DeviceReturned", GRIPPER) in kinds(events)
    assert ("DeviceReturned", TOOL) not in kinds(events)


def test_one_whose_eeprom_cannot_be_read_is_not_taken_for_the_one_before(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was given the address of the place to be asked who it is, and does not say."""
    asked: list[Station] = []

    def unreadable(station: Station) -> Procedure[Identity]:
        asked.append(station)
        yield []
        raise EepromError(f"{station}: EEPROM error")

    monkeypatch.setattr(restore, "identify", unreadable)
    events = run(cell, swap(TOOL, with_=Servo(name="tool", serial=99), at=0.1))
    assert len(asked) > 3  # at every look again
    [held] = [e for e in events if isinstance(e, event_types.DeviceHeld)]
    assert "identity of the device in its place cannot be read" in held.reason
    assert ("DeviceReturned", TOOL) not in kinds(events)
    assert cell.states[TOOL] & 0x0F < PRE_OP


def test_another_one_of_its_kind_is_taken_by_policy(cell: Cell) -> None:
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


def test_one_that_was_let_in_belongs_there_from_then_on(cell: Cell) -> None:
    """It is switched off once more, later: nobody has to let it in again."""

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


def test_one_held_because_it_refused_comes_back_when_it_is_released(cell: Cell) -> None:
    """Wherever it was when it was given up: here it had not even reached PRE-OP."""

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


def test_a_question_it_was_asked_before_it_fell_does_not_hold_it_up(cell: Cell) -> None:
    """Its mailbox is made anew, so nobody will answer: told at once, not after two seconds."""
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


def test_another_product_is_never_taken(cell: Cell) -> None:
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


def test_one_that_leaves_op_by_itself_is_led_back(cell: Cell) -> None:
    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 900:
            assert cell.states == [OP] * 5

    events = run(cell, leave_state(TOOL, at=0.2, state="SAFE-OP", code=0x001B), each=look)
    [lost] = [e for e in events if isinstance(e, event_types.StateLost)]
    assert (lost.sub, lost.state, lost.code) == (cell.subs[TOOL], 4, 0x001B)


def test_a_required_one_ends_the_loop(cell: Cell) -> None:
    with pytest.raises(WorkingCounterError):
        run(cell, power_cycle(1, at=0.2, for_=0.5), good=False)
    cell.let_pass(1.0)
    assert "OPERATION ENABLED" not in cell.drive_states


def test_a_required_one_that_leaves_op_ends_the_loop_while_another_is_astray(cell: Cell) -> None:
    with pytest.raises(StateError, match="device 2"):
        run(cell, power_cycle(TOOL, at=0.2, for_=0.5), leave_state(2, at=0.9), good=False)
    cell.let_pass(0.5)


def test_two_that_changed_places_are_both_told(cell: Cell) -> None:
    """One is the arm's: the loop ends; the scan after it finds what is there."""
    with pytest.raises(WorkingCounterError):
        run(cell, exchange(2, TOOL, at=0.2, for_=0.3), good=False)


@pytest.mark.parametrize("name", ["on_return", "on_replacement"])
def test_a_policy_there_is_not(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        cat.StopPolicy(**{name: "maybe"})  # type: ignore[arg-type]


def test_an_object_of_a_device_that_came_back_can_be_read(cell: Cell) -> None:
    """The handle is the same, its mailbox too."""
    answers = []

    def look(cycle, arm, tool, gripper, loop) -> None:
        if cycle.number == 1300:
            answers.append(cell.subs[TOOL].sdo.request(0x6041, type=UINT))

    run(cell, power_cycle(TOOL, at=0.2, for_=0.3), each=look)
    assert answers[0].done
    assert answers[0].result() & 0x4F


def test_a_watch_that_fails_is_no_secret(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits for its result while the loop runs: leaving tells."""

    def broken(at_most: int) -> Procedure[list[restore.Presence]]:
        yield []
        raise ZeroDivisionError(f"of {at_most}")

    monkeypatch.setattr(restore, "look_around", broken)
    with pytest.raises(ZeroDivisionError):
        run(cell, unplug(TOOL, at=0.1), seconds=0.3)
    assert cell.states[:TOOL] == [PRE_OP] * TOOL
