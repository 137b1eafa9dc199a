"""Objects of all devices are read without a pause while the drives move.
No cycle is lost, and the motion is the same. The devices share frames, and answers are not mixed.
A large object is transferred slowly next to the small ones, and arrives complete.
"""

import math

import pytest

import catenary as cat
from catenary.bus import Pending
from catenary.types import DINT, UDINT
from catenary.virtual import Coupler, Device, Servo
from tests.scenario.cell import cell_of

CYCLES = 600
SERIAL = (0x1018, 4)


def devices(count: int) -> list[Device]:
    return [Coupler(), *(Servo(serial=number) for number in range(1, count + 1))]


def positions(run: str, *, storm: bool) -> list[tuple[float, ...]]:
    """Return the positions of the drives in every cycle."""
    with cell_of(*devices(4)) as cell:
        arm = cell.drives()
        answers: dict[int, Pending[int]] = {}
        answered, found = 0, []
        with cat.Loop(arm, execution=run) as loop:  # type: ignore[arg-type]
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 0.2 * math.sin(2 * math.pi * cycle.time)
                found.append(tuple(arm.actual.position))
                for drive in cell.subs.drives if storm else ():
                    answer = answers.get(drive.position)
                    if answer is not None and answer.done:
                        assert answer.result() == drive.identity.serial
                        answered += 1
                    if answer is None or answer.done:
                        answers[drive.position] = drive.sdo.request(*SERIAL, type=UDINT)
                if cycle.number == CYCLES:
                    break
            assert loop.timing.counters["lost"] == 0
            assert loop.timing.counters["late"] == 0
            lane = loop.timing.counters["acyclic_sent"]
        assert not storm or answered >= 4 * CYCLES / 4.1
        assert lane <= CYCLES + 50  # one frame per cycle for all
        cell.assert_safe()
        return found


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_the_motion_is_the_same_with_and_without_a_storm(run: str) -> None:
    assert positions(run, storm=True) == positions(run, storm=False)


def test_a_large_object_arrives_during_a_storm() -> None:
    with cell_of(*devices(3)) as cell:
        arm = cell.drives()
        slow, *others = cell.subs.drives
        with cat.Loop(arm) as loop:
            large = slow.sdo.request(0x2100)
            small: list[Pending[int]] = []
            for cycle in loop:
                if not small or all(answer.done for answer in small[-2:]):
                    small += [drive.sdo.request(0x6064, type=DINT) for drive in others]
                if large.done or cycle.number == 500:
                    break
            assert loop.timing.counters["lost"] == 0
        assert large.result() == bytes(k * 7 & 0xFF for k in range(2048))
        assert len(small) > 20
        cell.assert_safe()
