"""Positions that continue between the commands of a client."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import catenary as cat
from tests.share.test_lease import LONG, Cell, cell_of

PERIOD = 1e-3


@pytest.fixture
def cell(name: str) -> Iterator[Cell]:
    with cell_of(name) as cell:
        yield cell


def targets(cell: Cell, cycles: int) -> list[float]:
    """Return the target of the first axis in each cycle."""
    found = []
    for _ in range(cycles):
        cell.cycles()
        found.append(float(cell.arm.target.position[0]))
    return found


def test_a_position_continues_with_its_velocity(cell: Cell) -> None:
    with cell.reader.lease([0], for_=LONG) as lease:
        lease.send([0.5], velocity=[2.0], extrapolate=True)
        np.testing.assert_allclose(targets(cell, 4), 0.5 + 2.0 * PERIOD * np.arange(4))
        assert cell.arm.target.velocity[0] == 2.0


def test_a_slow_client_commands_a_straight_line(cell: Cell) -> None:
    with cell.reader.lease([0], for_=LONG) as lease:
        found = []
        for n in range(5):
            lease.send([4 * n * PERIOD], velocity=[1.0], extrapolate=True)
            found += targets(cell, 4)
    np.testing.assert_allclose(np.diff(found), PERIOD)


def test_the_position_stops_after_20_ms(cell: Cell) -> None:
    with cell.reader.lease([0], for_=LONG) as lease:
        lease.send([0.0], velocity=[1.0], extrapolate=True)
        found = targets(cell, 40)
        assert found[20:] == [pytest.approx(0.020)] * 20
        assert cell.arm.target.velocity[0] == 0.0


def test_a_command_without_it_ends_the_motion(cell: Cell) -> None:
    with cell.reader.lease([0], for_=LONG) as lease:
        lease.send([0.0], velocity=[1.0], extrapolate=True)
        targets(cell, 3)
        lease.send([0.25])
        assert targets(cell, 3) == [0.25] * 3


def test_the_end_of_the_lease_ends_the_motion(cell: Cell) -> None:
    lease = cell.reader.lease([0], for_=LONG)
    lease.send([0.0], velocity=[1.0], extrapolate=True)
    targets(cell, 3)
    lease.release()
    found = targets(cell, 3)
    assert found == [found[0]] * 3
    assert cell.arm.target.velocity[0] == 0.0


def test_axes_of_other_clients_keep_their_motion(cell: Cell) -> None:
    with cell.reader.lease([0], for_=LONG) as lease, cat.attach(cell.share.name) as other:
        lease.send([0.0], velocity=[1.0], extrapolate=True)
        with other.lease([1], for_=LONG) as second:
            second.send([0.1])
            assert targets(cell, 3) == pytest.approx([0.0, 0.001, 0.002])
            assert cell.arm.target.position[1] == 0.1


def test_positions_and_velocities_are_required(cell: Cell) -> None:
    with cell.reader.lease([0], for_=LONG) as lease:
        for given in ({"position": [0.0]}, {"velocity": [0.0]}):
            with pytest.raises(ValueError, match="needs position= and velocity="):
                lease.send(**given, extrapolate=True)  # type: ignore[arg-type]
