"""Recovery of stopped drives on a virtual segment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.errors import DriveError
from catenary.virtual import Servo
from catenary.virtual.faults import cut, drive_fault, safe_torque_off

MS = 1e-3


class Rig:
    """Two drives in a loop, and their recovery."""

    def __init__(self, segment: cat.Segment, arm: cat.Drives, loop: cat.Loop, **options: float):
        self.segment, self.arm, self.loop = segment, arm, loop
        self.recovery = cat.drive.Recovery(arm, **options)
        self.phases: list[cat.drive.Phase] = []

    def run(self, cycles: int, reason: Callable[[float], str | None], **options: bool) -> None:
        for cycle in self.loop:
            phase = self.recovery.step(cycle, reason(cycle.time), **options)
            assert self.recovery.just_stopped == (
                bool(self.recovery.stops) and self.recovery.stops[-1].number == cycle.number
            )
            if self.phases[-1:] != [phase]:
                self.phases.append(phase)
            if cycle.number == cycles:
                return

    def states(self) -> list[str]:
        return [each.drive_state() for each in self.segment if isinstance(each, Servo)]


@contextmanager
def rig(*faults: object, **options: float) -> Iterator[Rig]:
    segment = cat.Segment([Servo(), Servo()])
    for fault in faults:
        segment.inject(fault)  # type: ignore[arg-type]
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0, required=False
        )
        with cat.Loop(
            arm, period=MS, stop=cat.StopPolicy(raise_faults=False, lost_limit=1000)
        ) as loop:
            yield Rig(segment, arm, loop, **options)


STARTING, RUNNING, STOPPED = cat.drive.Phase


def test_a_reason_causes_a_quick_stop_and_its_end_an_enable() -> None:
    with rig(after=0.1) as there:
        there.run(300, lambda now: "key" if 0.1 <= now < 0.15 else None)
        assert there.phases == [RUNNING, STOPPED, STARTING, RUNNING]
        [stop] = there.recovery.stops
        assert (stop.number, stop.reason) == (100, "key")
        assert there.states() == ["OPERATION ENABLED"] * 2


def test_nothing_moves_while_the_reason_holds() -> None:
    with rig(after=0.1) as there:
        there.run(400, lambda now: "key" if now >= 0.1 else None)
        assert there.phases == [RUNNING, STOPPED]
        assert len(there.recovery.stops) == 1
        assert "OPERATION ENABLED" not in there.states()


@pytest.mark.parametrize("lasting", [0.01, 0.7])
def test_faults_are_reset_until_their_cause_ends(lasting: float) -> None:
    with rig(drive_fault(1, at=1.0, for_=lasting), after=0.1) as there:
        there.run(2500, lambda now: "drive fault" if there.arm.faults else None)
        assert there.phases == [RUNNING, STOPPED, STARTING, RUNNING]
        assert there.states() == ["OPERATION ENABLED"] * 2


def test_a_lost_bus_and_the_faults_it_leaves() -> None:
    def reason(now: float) -> str | None:
        arm = there.arm
        return "lost bus" if not arm.present.all() else "drive fault" if arm.faults else None

    with rig(cut(between=("main", 0), at=1.0, for_=0.4), after=0.1) as there:
        there.run(3000, reason)
        assert [stop.reason for stop in there.recovery.stops] == ["lost bus"]
        assert there.phases == [RUNNING, STOPPED, STARTING, RUNNING]
        assert there.states() == ["OPERATION ENABLED"] * 2


def test_drives_that_cannot_be_enabled_are_named() -> None:
    with (
        pytest.raises(DriveError, match=r"not enabled within 0\.5 s: 1 "),
        rig(safe_torque_off(1, at=1.0), after=0.1, patience=0.5) as there,
    ):
        there.run(5000, lambda now: "safe torque off" if 1.0 < now < 1.1 else None)


def test_the_error_for_drives_that_are_not_ready() -> None:
    with (
        pytest.raises(DriveError, match="all drives are enabled, but not ready"),
        rig(patience=0.2) as there,
    ):
        there.run(1000, lambda now: None, ready=False)


def test_patience_begins_with_the_first_step() -> None:
    """The loop may have run for a long time before the first step."""
    with rig(patience=0.2) as there:
        for cycle in there.loop:
            if cycle.number == 500:
                break
        there.run(600, lambda now: None, ready=False)
        assert there.phases == [STARTING]


@pytest.mark.parametrize("options", [{"after": -1.0}, {"patience": 0.0}])
def test_invalid_times_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"), rig(**options):
        pass
