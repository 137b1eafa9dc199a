"""Commands of clients: two never have one axis; a lease ends when it is released, not renewed, or
its loop ends. (Clients that are killed: tests/scenario/72_client_killed_with_a_lease.py.)"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

import numpy as np
import pytest

import catenary as cat
from catenary.errors import LeaseError, ShareError
from catenary.share import Reason, lease
from catenary.share.command_table import COMMANDS, PLACES, Desk
from catenary.share.commands import CommandReader
from catenary.share.process import Process
from catenary.share.reader import Reader
from catenary.virtual import Segment, Servo

LONG = 600.0  # [s] no test takes so long


class Cell:
    """A loop of three axes in virtual time, its share, and a reader of it."""

    def __init__(self, arm: cat.Drives, loop: cat.Loop, share: cat.Share, reader: Reader) -> None:
        self.arm, self.loop, self.share, self.reader = arm, loop, share, reader
        self.names = reader.layout.axes

    def cycles(self, count: int = 1) -> list[cat.share.LeaseEnd]:
        ends = []
        for _ in range(count):
            next(self.loop)
            ends += self.share.apply(self.arm)
        return ends


@contextlib.contextmanager
def cell_of(name: str, **options: object) -> Iterator[Cell]:
    with cat.MainDevice(Segment([Servo(), Servo(), Servo()])) as main:
        given = {"counts_per_turn": 2**20, "velocity_limit": 100.0, **options}
        arm = cat.Drives(main.scan().drives, **given)  # type: ignore[arg-type]
        with cat.Share(name) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            with cat.attach(name) as reader:
                yield Cell(arm, loop, share, reader)


@pytest.fixture
def cell(name: str) -> Iterator[Cell]:
    with cell_of(name) as cell:
        yield cell


class Time:
    """The clock of the leases, as the test says."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1_000_000_000
        for module in (lease, cat.share.commands):
            monkeypatch.setattr(module.time, "monotonic_ns", lambda: self.now)

    def pass_(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Time:
    return Time(monkeypatch)


def test_what_a_client_sends_is_what_its_axes_do(cell: Cell) -> None:
    with cell.reader.lease(axes=[cell.names[2], 0], for_=LONG) as command:
        command.send(position=[0.02, 0.01])
        cell.cycles(200)
        now = cell.reader.read()
        assert now["commanded_position"] == pytest.approx([0.01, 0.0, 0.02])
        assert now["position"] == pytest.approx([0.01, 0.0, 0.02], abs=1e-4)


def test_the_newest_command_counts_and_quantities_stay_apart(name: str) -> None:
    with cell_of(name, mode="csv") as cell:
        with cell.reader.lease(for_=LONG) as command:
            for speed in (0.1, 0.2, 0.3):
                command.send(velocity=speed)
            cell.cycles()
            assert (cell.arm.target.velocity == 0.3).all()
            assert (cell.arm.target.torque == 0.0).all()
        ends = cell.cycles()
        assert [end.reason for end in ends] == [Reason.RELEASED]
        assert (cell.arm.target.velocity == 0.0).all()


def test_commands_can_be_read_one_by_one(cell: Cell) -> None:
    with cell.reader.lease(axes=[1], for_=LONG) as command:
        for k in range(3):
            command.send(position=0.001 * k, torque=[0.1])
        taken = cell.share.commands()
        assert [each.axes for each in taken] == [(1,)] * 3
        assert [each.position.item() for each in taken] == pytest.approx([0.0, 0.001, 0.002])  # type: ignore[union-attr]
        assert taken[0].velocity is None
        assert taken[0].client.is_alive
        assert cell.share.commands() == []


def test_no_axis_has_two_masters(cell: Cell) -> None:
    with cell.reader.lease(axes=[0, 1], for_=LONG):
        with pytest.raises(LeaseError, match=r"'1 .*' is leased to process \d+ .* for another"):
            cell.reader.lease(axes=[1, 2], for_=LONG)
        with cell.reader.lease(axes=[2], for_=LONG):
            pass
    with cell.reader.lease(axes=[1, 2], for_=LONG):
        pass


def test_a_lease_that_is_not_renewed_ends_and_its_axis_holds(cell: Cell, clock: Time) -> None:
    command = cell.reader.lease(axes=[0], for_=0.5)
    command.send(position=0.01)
    cell.cycles(20)
    clock.pass_(0.4)
    command.renew()
    clock.pass_(0.4)
    assert cell.cycles() == []
    clock.pass_(0.2)
    [end] = cell.cycles()
    assert (end.axes, end.reason) == ((cell.names[0],), Reason.EXPIRED)
    assert "not renewed in time" in str(end)
    with pytest.raises(LeaseError, match="is over: not renewed in time"):
        command.send(position=0.02)
    cell.cycles(20)
    assert cell.arm.target.position[0] == pytest.approx(0.01)
    command.release()  # harmless


def test_the_next_client_takes_what_has_expired_before_the_loop_looks(
    cell: Cell, clock: Time
) -> None:
    late = cell.reader.lease(axes=[0, 1], for_=0.5)
    cell.cycles()
    clock.pass_(0.6)
    with cell.reader.lease(axes=[1], for_=0.5) as command:
        with pytest.raises(LeaseError, match="is over"):
            late.send(position=[1.0, 1.0])
        command.send(position=0.003)
        ends = cell.cycles()
        assert [(end.axes, end.reason) for end in ends] == [
            ((cell.names[0], cell.names[1]), Reason.EXPIRED)
        ]
        assert cell.arm.target.position[1] == pytest.approx(0.003)
        assert cell.cycles() == []


def test_what_was_sent_under_a_lease_that_is_over_is_not_taken(cell: Cell) -> None:
    with cell.reader.lease(axes=[0], for_=LONG) as command:
        cell.cycles()
        command.send(position=1.0)
    cell.cycles(5)
    assert cell.arm.target.position[0] == pytest.approx(0.0, abs=1e-6)


def test_an_axis_holds_where_it_is_commanded_and_not_where_it_was_sent(name: str) -> None:
    with cell_of(name, velocity_limit=1.0, step_limit=2.0) as cell:
        with cell.reader.lease(axes=[0], for_=LONG) as command:
            command.send(position=1.0)  # a thousand cycles away
            cell.cycles(10)
        cell.cycles(10)
        assert 0.005 < cell.arm.target.position[0] < 0.012


def test_a_loop_that_does_not_take_commands_is_noticed(cell: Cell) -> None:
    with cell.reader.lease(axes=[0], for_=LONG) as command:
        for _ in range(COMMANDS):
            command.send(position=0.0)
        with pytest.raises(LeaseError, match=r"share\.apply"):
            command.send(position=0.0)
        cell.cycles()
        command.send(position=0.0)


def test_a_client_that_was_stopped_with_the_desk_does_not_hold_others_for_ever(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lease, "PATIENCE_NS", 10_000_000)
    with cell.reader.lease(axes=[0], for_=LONG) as command:
        mutex = command._desk.mutex
        has_it, may_go = threading.Event(), threading.Event()

        def hold() -> None:
            mutex.lock(0)
            has_it.set()
            may_go.wait()
            mutex.unlock()

        other = threading.Thread(target=hold)
        other.start()
        has_it.wait()
        with pytest.raises(LeaseError, match="another client has held the desk"):
            command.send(position=0.0)
        assert cell.cycles(3) == []  # the loop does not notice
        may_go.set()
        other.join()


def test_axes_of_several_drives(name: str) -> None:
    with cat.MainDevice(Segment([Servo(), Servo(), Servo()])) as main:
        subs = main.scan().drives
        left = cat.Drives(subs[:1], counts_per_turn=2**20, velocity_limit=100.0)
        right = cat.Drives(subs[1:], counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name) as share, cat.Loop(left, right, sink=share) as loop:
            next(loop)
            with cat.attach(name) as reader, reader.lease(for_=LONG) as command:
                command.send(position=[0.001, 0.002, 0.003])
                share.apply(left, right)
                assert left.target.position.tolist() == [0.001]
                assert right.target.position.tolist() == [0.002, 0.003]


def test_as_many_clients_as_there_are_places(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.share.lease.axis_numbers", lambda *_: [])
    leases = [cell.reader.lease(for_=LONG) for _ in range(PLACES)]
    with pytest.raises(LeaseError, match=f"{PLACES} clients"):
        cell.reader.lease(for_=LONG)
    leases[3].release()
    cell.reader.lease(for_=LONG)


def test_a_place_that_changes_hands_while_the_loop_looks(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop takes no lock: a lease it reads may be given back and its place taken by another
    client meanwhile. It must not make one lease of the two, nor lose what the other sends."""
    leases = [cell.reader.lease(axes=[0], for_=LONG)]
    client_of = Desk.client

    def changes_hands(desk: Desk, place: int) -> Process:
        if len(leases) == 1:
            leases[0].release()
            leases.append(cell.reader.lease(axes=[1, 2], for_=LONG))
        return client_of(desk, place)

    monkeypatch.setattr(Desk, "client", changes_hands)
    assert cell.share.commands() == []  # nothing was sent
    leases[1].send(position=[0.001, 0.002])
    monkeypatch.undo()
    [command] = cell.share.commands()
    assert command.axes == (1, 2)
    leases[1].release()
    cell.share.commands()
    assert [end.axes for end in cell.share.ended()] == [cell.names[1:]]


def test_a_command_of_a_lease_that_the_loop_has_not_seen_yet_stays(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = cell.reader.lease(axes=[0], for_=LONG)
    cell.share.commands()
    follow = CommandReader._follow_leases

    def and_then_another_takes_it(reader: CommandReader) -> None:
        follow(reader)
        first.release()
        cell.reader.lease(axes=[0], for_=LONG).send(position=0.001)

    monkeypatch.setattr(CommandReader, "_follow_leases", and_then_another_takes_it)
    assert cell.share.commands() == []
    monkeypatch.undo()
    [command] = cell.share.commands()
    assert command.position == pytest.approx([0.001])


def test_a_lease_taken_while_the_loop_ends_is_over(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with cell_of(name) as cell:
        cell.reader.lease()  # opens the desk
        cell.cycles()
    monkeypatch.setattr(Reader, "alive", True)  # as it was when it was asked
    with (
        pytest.raises(LeaseError, match="the loop has ended"),
        cell.reader.lease(for_=LONG) as command,
    ):
        command.send(position=0.0)


def test_the_end_of_the_loop_ends_all_leases(name: str) -> None:
    with cat.MainDevice(Segment([Servo()])) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, sink=share) as loop:
            next(loop)
            reader = cat.attach(name)
            command = reader.lease(for_=LONG)
            command.send(position=0.0)
        with pytest.raises(LeaseError, match="the loop has ended"):
            command.send(position=0.0)
        with pytest.raises(ShareError, match="has ended"):
            reader.lease()
        with cat.Loop(arm, sink=share) as loop:
            next(loop)
            assert share.commands() == []
            with cat.attach(name).lease(for_=LONG) as command:
                command.send(position=0.0)
                assert len(share.commands()) == 1


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        ({"axes": ["elbow"]}, "no axis 'elbow'"),
        ({"axes": [3]}, "no axis 3"),
        ({"axes": [0, 0]}, "each once"),
        ({"axes": []}, "at least one"),
        ({"axes": "0 Servo"}, "a list of names"),
        ({"for_": 0.0}, "more than 0"),
        ({"for_": float("nan")}, "more than 0"),
    ],
)
def test_refuses_what_cannot_be_leased(cell: Cell, asked: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        cell.reader.lease(**asked)


@pytest.mark.parametrize(
    ("sent", "named"),
    [
        ({}, "nothing to send"),
        ({"position": [1.0, 2.0]}, r"each of 1 axes, not \(2,\)"),
        ({"velocity": np.nan}, "NaN or infinity"),
    ],
)
def test_refuses_what_cannot_be_sent(cell: Cell, sent: dict, named: str) -> None:
    with (
        cell.reader.lease(axes=[0], for_=LONG) as command,
        pytest.raises(ValueError, match=named),
    ):
        command.send(**sent)


def test_a_share_without_a_loop_takes_no_commands(name: str) -> None:
    with cat.Share(name) as share, pytest.raises(RuntimeError, match="before a Loop is open"):
        share.commands()
