"""Leases and commands of clients: exclusive axes, and the reasons why a lease ends.

Killed clients: see tests/scenario/72_client_killed_with_a_lease.py.
"""

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

LONG = 600.0  # [s] longer than any test


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
    """Clock of the leases, which the test advances."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1_000_000_000
        for module in (lease, cat.share.commands):
            monkeypatch.setattr(module.time, "monotonic_ns", lambda: self.now)

    def pass_(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Time:
    return Time(monkeypatch)


def test_axes_follow_the_commands_of_the_client(cell: Cell) -> None:
    with cell.reader.lease(axes=[cell.names[2], 0], for_=LONG) as command:
        command.send(position=[0.02, 0.01])
        cell.cycles(200)
        now = cell.reader.read()
        assert now["commanded_position"] == pytest.approx([0.01, 0.0, 0.02])
        assert now["position"] == pytest.approx([0.01, 0.0, 0.02], abs=1e-4)


def test_newest_command_is_applied_to_its_quantity_only(name: str) -> None:
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


def test_leased_axis_is_refused_to_another_client(cell: Cell) -> None:
    with cell.reader.lease(axes=[0, 1], for_=LONG):
        with pytest.raises(LeaseError, match=r"'1 .*' is leased to process \d+ .* for another"):
            cell.reader.lease(axes=[1, 2], for_=LONG)
        with cell.reader.lease(axes=[2], for_=LONG):
            pass
    with cell.reader.lease(axes=[1, 2], for_=LONG):
        pass


def test_expired_lease_ends_and_its_axis_holds(cell: Cell, clock: Time) -> None:
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
    with pytest.raises(LeaseError, match="has ended: not renewed in time"):
        command.send(position=0.02)
    cell.cycles(20)
    assert cell.arm.target.position[0] == pytest.approx(0.01)
    command.release()  # harmless


def test_expired_axis_can_be_leased_before_the_loop_detects_the_end(
    cell: Cell, clock: Time
) -> None:
    late = cell.reader.lease(axes=[0, 1], for_=0.5)
    cell.cycles()
    clock.pass_(0.6)
    with cell.reader.lease(axes=[1], for_=0.5) as command:
        with pytest.raises(LeaseError, match="has ended"):
            late.send(position=[1.0, 1.0])
        command.send(position=0.003)
        ends = cell.cycles()
        assert [(end.axes, end.reason) for end in ends] == [
            ((cell.names[0], cell.names[1]), Reason.EXPIRED)
        ]
        assert cell.arm.target.position[1] == pytest.approx(0.003)
        assert cell.cycles() == []


def test_commands_of_an_ended_lease_are_discarded(cell: Cell) -> None:
    with cell.reader.lease(axes=[0], for_=LONG) as command:
        cell.cycles()
        command.send(position=1.0)
    cell.cycles(5)
    assert cell.arm.target.position[0] == pytest.approx(0.0, abs=1e-6)


def test_axis_holds_its_commanded_position_and_not_its_target(name: str) -> None:
    with cell_of(name, velocity_limit=1.0, step_limit=2.0) as cell:
        with cell.reader.lease(axes=[0], for_=LONG) as command:
            command.send(position=1.0)  # a thousand cycles away
            cell.cycles(10)
        cell.cycles(10)
        assert 0.005 < cell.arm.target.position[0] < 0.012


def test_send_fails_if_the_loop_does_not_read_commands(cell: Cell) -> None:
    with cell.reader.lease(axes=[0], for_=LONG) as command:
        for _ in range(COMMANDS):
            command.send(position=0.0)
        with pytest.raises(LeaseError, match=r"share\.apply"):
            command.send(position=0.0)
        cell.cycles()
        command.send(position=0.0)


def test_client_stopped_with_the_lock_does_not_block_others(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lease, "LOCK_TIMEOUT_NS", 10_000_000)
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
        with pytest.raises(LeaseError, match="another client has locked the desk"):
            command.send(position=0.0)
        assert cell.cycles(3) == []  # the loop is not affected
        may_go.set()
        other.join()


def test_commands_reach_the_axes_of_several_drives(name: str) -> None:
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


def test_number_of_clients_is_limited(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.share.lease.axis_numbers", lambda *_: [])
    leases = [cell.reader.lease(for_=LONG) for _ in range(PLACES)]
    with pytest.raises(LeaseError, match=f"{PLACES} clients"):
        cell.reader.lease(for_=LONG)
    leases[3].release()
    cell.reader.lease(for_=LONG)


def test_place_is_reassigned_while_the_loop_reads_it(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the loop reads a lease without the lock, another client can take over the place.

    The loop must neither mix the two leases nor lose commands of the second one.
    """
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


def test_command_of_an_unrecorded_lease_is_kept(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = cell.reader.lease(axes=[0], for_=LONG)
    cell.share.commands()
    follow = CommandReader._follow_leases

    def follow_and_replace(reader: CommandReader) -> None:
        follow(reader)
        first.release()
        cell.reader.lease(axes=[0], for_=LONG).send(position=0.001)

    monkeypatch.setattr(CommandReader, "_follow_leases", follow_and_replace)
    assert cell.share.commands() == []
    monkeypatch.undo()
    [command] = cell.share.commands()
    assert command.position == pytest.approx([0.001])


def test_lease_taken_while_the_loop_ends_is_not_valid(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with cell_of(name) as cell:
        cell.reader.lease()  # opens the desk
        cell.cycles()
    monkeypatch.setattr(Reader, "alive", True)  # the loop ends just after the check
    with (
        pytest.raises(LeaseError, match="the loop has ended"),
        cell.reader.lease(for_=LONG) as command,
    ):
        command.send(position=0.0)


def test_end_of_the_loop_ends_all_leases(name: str) -> None:
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
    ("arguments", "message"),
    [
        ({"axes": ["elbow"]}, "no axis 'elbow'"),
        ({"axes": [3]}, "no axis 3"),
        ({"axes": [0, 0]}, "each axis only once"),
        ({"axes": []}, "at least one"),
        ({"axes": "0 Servo"}, "a list of names"),
        ({"for_": 0.0}, "must be positive"),
        ({"for_": float("nan")}, "must be positive"),
    ],
)
def test_invalid_arguments_of_a_lease_are_refused(
    cell: Cell, arguments: dict, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        cell.reader.lease(**arguments)


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        ({}, "nothing to send"),
        ({"position": [1.0, 2.0]}, r"has shape \(2,\); pass a scalar or shape \(1,\)"),
        ({"velocity": np.nan}, "NaN or infinity"),
    ],
)
def test_invalid_set_points_are_refused(cell: Cell, sent: dict, message: str) -> None:
    with (
        cell.reader.lease(axes=[0], for_=LONG) as command,
        pytest.raises(ValueError, match=message),
    ):
        command.send(**sent)


def test_share_without_a_loop_refuses_to_read_commands(name: str) -> None:
    with cat.Share(name) as share, pytest.raises(RuntimeError, match="before a Loop is open"):
        share.commands()
