"""Bits of frames are inverted, more often than by any cable.
Nothing crashes or waits forever. Broken frames are counted.
In every case, all drives stand still at the end.
"""

import pytest

import catenary as cat
from catenary.errors import CatenaryError
from catenary.link import Fault
from tests.scenario.cell import Cell

INDEX_OF_FIRST_DATAGRAM = 17


def test_a_frame_with_a_wrong_index_is_ignored(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 50:
                cell.spoil("corrupt", 2, offset=INDEX_OF_FIRST_DATAGRAM)
            if cycle.number == 100:
                break
        assert loop.timing.counters["lost"] == 2
    cell.assert_safe()


@pytest.mark.parametrize("seed", range(8))
def test_noise_on_the_line_never_crashes(cell: Cell, seed: int) -> None:
    arm = cell.drives(velocity_limit=20.0)
    noise = Fault(kind="corrupt", traffic="cyclic", probability=0.02 * (seed + 1))
    ended: CatenaryError | None = None
    try:
        with cat.Loop(arm) as loop:
            cell.link.inject(noise)
            for cycle in loop:
                if cycle.number == 500:
                    break
    except CatenaryError as error:
        ended = error
    assert cell.link.injected["corrupt"] > 0
    cell.assert_safe()
    assert ended is None or ended.message


def test_duplicate_frames_are_used_once(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        cell.link.inject(Fault(kind="duplicate", traffic="cyclic"))
        for cycle in loop:
            assert cycle.ok
            if cycle.number == 100:
                break
        counters = loop.timing.counters
    assert counters["lost"] == 0
    assert counters["duplicate"] + counters["stale"] >= 100
