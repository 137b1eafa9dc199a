"""Leases and commands of C programs: the rules are those of Python (tests/share/test_lease.py)."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import DriveError, LeaseError
from catenary.share import LeaseEnd, Reason
from catenary.share.command_table import COMMANDS, PLACES
from catenary.virtual import Segment, Servo
from tests.share.c.library import (
    ARGUMENT,
    ENDED,
    FULL,
    LEASE_ENDED,
    LEASED,
    NO_COMMANDS,
    NOT_READ,
    CError,
    CShare,
    Library,
)
from tests.share.processes import Program, comes_true
from tests.share.test_lease import Cell, cell_of


@pytest.fixture
def cell(name: str) -> Iterator[Cell]:
    with cell_of(name) as cell:
        yield cell


@pytest.fixture
def share(cell: Cell, name: str, library: Library) -> Iterator[CShare]:
    with library.attach(name) as share:
        yield share


def test_axes_follow_the_commands(cell: Cell, share: CShare) -> None:
    command = share.lease([2, 0])
    command.send(position=[0.02, 0.01])
    assert cell.cycles(200) == []
    share.read()
    assert share.values("commanded_position") == pytest.approx([0.01, 0.0, 0.02])
    assert share.values("position") == pytest.approx([0.01, 0.0, 0.02], abs=1e-4)
    command.release()
    [end] = cell.cycles()
    assert end.axes == (cell.names[0], cell.names[2])
    assert end.reason == Reason.RELEASED


def test_each_quantity_reaches_its_target(cell: Cell, share: CShare) -> None:
    command = share.lease()
    command.send(velocity=[0.1, 0.2, 0.3], torque=[1.0, 2.0, 3.0])
    [taken] = cell.share.commands()
    assert taken.axes == (0, 1, 2)
    assert taken.position is None
    assert taken.velocity == pytest.approx([0.1, 0.2, 0.3])
    assert taken.torque == pytest.approx([1.0, 2.0, 3.0])
    assert taken.client.is_alive
    assert "python" in taken.client.command
    command.release()


def test_leased_axis_is_refused_with_the_name_of_its_client(cell: Cell, share: CShare) -> None:
    command = share.lease([0, 1])
    with pytest.raises(CError, match=r"axis '1 .*' is leased to process \d+ \(.+\) for") as caught:
        share.lease([2, 1])
    assert caught.value.code == LEASED
    with pytest.raises(LeaseError, match="is leased to process"):
        cell.reader.lease(axes=[1])
    command.release()
    with cell.reader.lease(axes=[1]):
        with pytest.raises(CError, match="is leased to process"):
            share.lease([1])
        share.lease([0]).release()
    share.lease([1]).release()


def test_lease_that_is_not_renewed_ends(cell: Cell, share: CShare) -> None:
    command = share.lease([0], duration=1e-6)
    assert comes_true(lambda: bool(cell.cycles()) or False)
    with pytest.raises(CError, match="has ended: not renewed in time") as caught:
        command.send(position=[0.0])
    assert caught.value.code == LEASE_ENDED
    with pytest.raises(CError, match="has ended"):
        command.renew()
    command.release()


def test_renewed_lease_gets_a_later_deadline(cell: Cell, share: CShare) -> None:
    command = share.lease([0])
    desk = cell.share._desk
    assert desk is not None
    before = max(desk.deadlines_ns.load_all())
    command.renew()
    after = max(desk.deadlines_ns.load_all())
    assert before < after <= time.monotonic_ns() + 600_000_000_000
    command.release()


def test_send_fails_if_the_loop_does_not_read_commands(cell: Cell, share: CShare) -> None:
    command = share.lease([0])
    for _ in range(COMMANDS):
        command.send(position=[0.0])
    with pytest.raises(CError, match=r"share\.apply") as caught:
        command.send(position=[0.0])
    assert caught.value.code == NOT_READ
    cell.cycles()
    command.send(position=[0.0])
    command.release()


def test_number_of_clients_is_limited(name: str, library: Library) -> None:
    with cat.MainDevice(Segment([Servo() for _ in range(PLACES + 1)])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Share(name) as share, cat.Loop(arm, sink=share), library.attach(name) as reader:
            leases = [reader.lease([k]) for k in range(PLACES)]
            with pytest.raises(CError, match=f"{PLACES} clients") as caught:
                reader.lease([PLACES])
            assert caught.value.code == FULL
            leases[3].release()
            leases[3] = reader.lease([PLACES])
            for lease in leases:
                lease.release()


def test_end_of_the_loop_ends_the_lease(name: str, library: Library) -> None:
    with cell_of(name) as cell:
        share = library.attach(name)
        command = share.lease()
        cell.cycles()
    with share:
        with pytest.raises(CError, match="the loop has ended") as caught:
            command.send(position=[0.0] * 3)
        assert caught.value.code == LEASE_ENDED
        command.release()
        with pytest.raises(CError, match="has ended") as caught:
            share.lease()
        assert caught.value.code == ENDED


def test_desk_of_a_later_loop_is_refused(name: str, library: Library) -> None:
    with cat.MainDevice(Segment([Servo()])) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, sink=share):
            reader = library.attach(name)
        with cat.Loop(arm, sink=share), reader:
            with pytest.raises(CError, match="now belongs to another loop") as caught:
                library.checked("stop", reader.handle)
            assert caught.value.code == ENDED


def test_share_without_a_socket_accepts_no_commands(
    cell: Cell, share: CShare, library: Library
) -> None:
    assert cell.share._socket is not None
    cell.share._socket.path.unlink()
    with pytest.raises(CError, match="does not accept commands") as caught:
        library.checked("stop", share.handle)
    assert caught.value.code == NO_COMMANDS


@pytest.mark.parametrize(
    ("axes", "duration", "message"),
    [
        ([3], 1.0, "no axis 3; it has 3 axes"),
        ([1, 1], 1.0, "given twice"),
        ([], 1.0, "at least one axis"),
        ([0], 0.0, "must be positive"),
        ([0], 3601.0, "at most 3600 s"),
        ([0], math.nan, "must be positive"),
    ],
)
def test_invalid_arguments_of_a_lease_are_refused(
    share: CShare, axes: list[int], duration: float, message: str
) -> None:
    with pytest.raises(CError, match=message) as caught:
        share.lease(axes, duration)
    assert caught.value.code == ARGUMENT


def test_invalid_set_points_are_refused(cell: Cell, share: CShare) -> None:
    command = share.lease([0])
    with pytest.raises(CError, match="nothing to send"):
        command.send()
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(CError, match="NaN or infinite"):
            command.send(velocity=[value])
    assert cell.share.commands() == []
    command.release()


def test_stop_needs_no_lease(cell: Cell, share: CShare, library: Library) -> None:
    with cell.reader.lease():
        library.checked("stop", share.handle)
        with pytest.raises(DriveError, match=rf"an operator .* \(process {os.getpid()}\)"):
            cell.cycles(10)


def test_axis_of_a_killed_program_holds(cell: Cell, name: str, program: Path) -> None:
    ended: list[LeaseEnd] = []

    def cycle() -> bool:
        ended.extend(cell.cycles(20))
        return bool(ended)

    client = Program.of([str(program), "hold", name, "1"])
    try:
        assert comes_true(lambda: cycle() or cell.arm.target.position[1] > 0.01)
        assert ended == []
        client.kill()
        assert comes_true(cycle)
    finally:
        client.kill()
        client.close()
    [end] = ended
    assert (end.axes, end.reason) == ((cell.names[1],), Reason.DIED)
    assert (end.client.pid, end.client.command) == (client.process.pid, "client")
    held = cell.arm.target.position[1]
    cell.cycles(200)
    assert cell.arm.target.position[1] == held > 0.01
    assert cell.arm.actual.position[1] == pytest.approx(held, abs=1e-4)
    with cell.reader.lease(axes=[1]):
        pass
