"""The device with the reference clock is switched off and on. The other clocks continue with the
expected time in the frame, at the measured rate, and no pulse misses its outputs.
The returned reference clock is set by the others before it is the reference again.
A follower that is switched off gets its time and its SYNC0 back in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

import catenary as cat
from catenary.bus import event_types
from catenary.virtual import Junction, Servo
from catenary.virtual.faults import power_cycle
from tests.scenario.cell import OP, Cell, cell_of
from tests.scenario.clocked import crystal

FIRST, SECOND, THIRD = 1, 2, 3


@pytest.fixture
def star() -> Iterator[Cell]:
    """Yield a junction with three servos at separate ports, so that each can fail alone."""
    random = Random(3)
    servos = [Servo(serial=k, crystal=crystal(random)) for k in (1, 2, 3)]
    behind = {1: (0, 3), 2: (0, 1), 3: (0, 2)}
    with cell_of(Junction(port_count=4), *servos, behind=behind) as cell:
        yield cell


def ride(cell: Cell, vanishing: int, seconds: float = 6.0) -> list[event_types.Event]:
    """Switch one device off for half a second, and check the others."""
    others = [cell.subs[p] for p in (FIRST, SECOND, THIRD) if p != vanishing]
    arm = cat.Drives(others, counts_per_turn=2**20, velocity_limit=100.0, dc=True)
    tool = cat.Drives(
        [cell.subs[vanishing]], counts_per_turn=2**20, velocity_limit=100.0, dc=True, required=False
    )
    core = cell.segment.core
    with cat.Loop(
        arm, tool, period=1e-3, clocks=cat.ClockOptions(reference=cell.subs[FIRST])
    ) as loop:
        loop.wait_locked()
        list(cell.main.events)
        missed = {sub.position: core.synchronous(sub.position)[2] for sub in others}
        cell.segment.inject(power_cycle(vanishing, for_=0.5))
        start: float | None = None
        for cycle in loop:
            start = cycle.time if start is None else start
            assert cycle.ok
            assert arm.enabled.all()
            if cycle.time - start >= seconds:
                break
        assert {p: core.synchronous(p)[2] for p in missed} == missed
        assert loop.clocks.locked
        assert loop.clocks.jumps == 0
        assert cell.states[vanishing] == OP
        times = [core.system_time(position) for position in (FIRST, SECOND, THIRD)]
        assert max(times) - min(times) < 1500
        assert core.pulses(vanishing)[0] > 0
    cell.assert_safe()
    return list(cell.main.events)


def kinds(events: list[event_types.Event]) -> list[str]:
    told = (
        event_types.ClockLocked,
        event_types.ClockUnlocked,
        event_types.DeviceLost,
        event_types.DeviceReturned,
    )
    return [type(e).__name__ for e in events if isinstance(e, told)]


def test_the_reference_is_switched_off_and_on(star: Cell) -> None:
    events = ride(star, FIRST)
    assert set(kinds(events)) == {"ClockUnlocked", "ClockLocked", "DeviceLost", "DeviceReturned"}
    left = next(e for e in events if isinstance(e, event_types.ClockUnlocked))
    assert left.sub is star.subs[FIRST]
    assert "the reference clock, does not answer" in left.message
    assert kinds(events)[-1] == "ClockLocked"


def test_a_follower_is_switched_off_and_on(star: Cell) -> None:
    events = ride(star, SECOND)
    assert {"DeviceLost", "DeviceReturned"} <= set(kinds(events))
