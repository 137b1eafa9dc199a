"""The set-point handshake of profile position, and its errors if a drive does not reply."""

from __future__ import annotations

import pytest

from catenary.drive.motions import AT_ONCE, HALT, NEW_SET_POINT, move_profile, stop_profile
from catenary.drive.port import AxisFacts, AxisPort, Steps
from catenary.drive.profile import Rates
from catenary.drive.units import AxisUnits
from catenary.errors import MoveError, SdoAbort
from catenary.plan.request import RequestTables
from catenary.wire.cia402 import Mode
from tests.core.rig import axis
from tests.drive.fakes import views_of

RATES = Rates(1.0, 2.0)
ACKNOWLEDGED, REACHED = 0x1000, 0x0400
PERIOD = 1e-3


class Answer:
    """Result of a write by SDO."""

    def __init__(self, code: int | None) -> None:
        self.done = True
        self.code = code

    def result(self) -> None:
        if self.code is not None:
            raise SdoAbort("refused", position=0, index=0, subindex=0, code=self.code)


class Rig:
    """One axis without a drive, whose statusword the test sets."""

    def __init__(self, *, refused: dict[int, int] | None = None) -> None:
        self.views = views_of(RequestTables(axes=(axis(0),)))
        self.views.axis_flags[0] = 1 | 1 << 6
        self.writes: list[tuple[int, int]] = []
        self.refused = refused or {}
        self.port = AxisPort(
            self.views,
            0,
            AxisFacts("left", AxisUnits(1000), PERIOD, PERIOD, measures_velocity=True),
            write=self.write,  # type: ignore[arg-type]
            put_rate=lambda name, value: False,
        )

    def write(self, index: int, value: int) -> Answer:
        self.writes.append((index, value))
        return Answer(self.refused.get(index))

    @property
    def bits(self) -> int:
        return self.views.controlword_bits.item(0)

    def run(self, steps: Steps, cycles: int) -> bool:
        """Step for some cycles. Return True if the motion ended."""
        for _ in range(cycles):
            self.port.now += PERIOD
            try:
                next(steps)
            except StopIteration:
                return True
        return False


def test_each_bit_keeps_its_level_until_the_drive_replies() -> None:
    rig = Rig()
    steps = move_profile(rig.port, 1.0, RATES)
    rig.run(steps, 50)
    assert rig.bits == NEW_SET_POINT | AT_ONCE
    assert rig.views.target_position[0] == 1.0
    rig.views.statusword[0] = ACKNOWLEDGED
    rig.run(steps, 50)
    assert rig.bits == 0
    rig.views.statusword[0] = 0
    assert not rig.run(steps, 50)
    rig.views.statusword[0] = REACHED
    assert rig.run(steps, 2)
    assert [index for index, _ in rig.writes] == [0x6081, 0x6083, 0x6084]


def test_rates_are_written_when_they_change() -> None:
    rig = Rig()
    for rates in (RATES, RATES, Rates(0.5, 2.0)):
        steps = move_profile(rig.port, 1.0, rates)
        rig.run(steps, 3)
        rig.views.statusword[0] = ACKNOWLEDGED
        rig.run(steps, 3)
        rig.views.statusword[0] = 0
        rig.run(steps, 3)
    assert [index for index, _ in rig.writes] == [0x6081, 0x6083, 0x6084, 0x6081]


def test_a_drive_without_0x6084_uses_0x6083() -> None:
    rig = Rig(refused={0x6084: 0x06020000})
    rig.run(move_profile(rig.port, 1.0, RATES), 3)
    assert rig.bits & NEW_SET_POINT


def test_a_rate_that_the_drive_refuses_ends_the_move_before_it_begins() -> None:
    rig = Rig(refused={0x6081: 0x06090030})
    with pytest.raises(SdoAbort):
        rig.run(move_profile(rig.port, 1.0, RATES), 3)
    assert rig.bits == HALT  # a previous move may still be running


def test_a_set_point_that_is_not_acknowledged() -> None:
    rig = Rig()
    with pytest.raises(MoveError, match=r"left did not acknowledge the set-point .*bit 12") as e:
        rig.run(move_profile(rig.port, 1.0, RATES), 1100)
    assert e.value.remaining == 1.0
    assert rig.bits & HALT  # the drive may still be moving


def test_a_drive_that_does_not_accept_another_set_point() -> None:
    rig = Rig()
    rig.views.statusword[0] = ACKNOWLEDGED
    with pytest.raises(MoveError, match="left did not become ready for another set-point"):
        rig.run(move_profile(rig.port, 1.0, RATES), 1100)
    assert rig.bits == HALT


def test_a_target_that_is_never_reached() -> None:
    rig = Rig()
    steps = move_profile(rig.port, 1.0, RATES)
    rig.run(steps, 5)
    rig.views.statusword[0] = ACKNOWLEDGED
    rig.run(steps, 5)
    rig.views.statusword[0] = 0
    with pytest.raises(
        MoveError, match=r"did not report that it reached the target \(statusword bit 10\)"
    ):
        rig.run(steps, 10_000)
    assert rig.bits == HALT


def test_halt_ends_when_the_hold_set_point_is_acknowledged() -> None:
    rig = Rig()
    rig.views.actual_velocity[0] = 1.0
    steps = stop_profile(rig.port)
    rig.run(steps, 100)
    assert rig.bits == HALT
    rig.views.actual_velocity[0] = 0.0
    rig.views.actual_position[0] = 0.4
    for _ in range(100):
        rig.run(steps, 1)
        if rig.bits != HALT:
            break
    assert rig.bits == NEW_SET_POINT | AT_ONCE | HALT
    assert rig.views.target_position[0] == 0.4
    rig.views.statusword[0] = ACKNOWLEDGED
    rig.run(steps, 1)
    assert rig.bits == 0


def test_halt_stays_set_if_the_stop_is_not_acknowledged() -> None:
    rig = Rig()
    steps = stop_profile(rig.port)
    for _ in range(1000):
        rig.run(steps, 1)
        assert rig.bits & HALT  # otherwise the drive would continue to its old goal
    with pytest.raises(MoveError, match="did not acknowledge"):
        rig.run(steps, 1000)
    assert rig.bits & HALT


@pytest.mark.parametrize(
    ("acknowledged", "target", "start"), [(0.4, 0.4, 0.4), (0.4, 5.0, 0.39), (None, 0.4, 0.39)]
)
def test_a_target_that_the_drive_has_not_received_is_not_a_start(
    acknowledged: float | None, target: float, start: float
) -> None:
    rig = Rig()
    rig.views.mode_target[0] = Mode.PP
    rig.views.actual_position[0] = 0.39
    rig.port.handed_over = acknowledged
    rig.views.target_position[0] = target
    assert rig.port.rest == start


def test_an_axis_that_does_not_stop() -> None:
    rig = Rig()
    rig.views.actual_velocity[0] = 1.0
    with pytest.raises(MoveError, match="did not stop within 5 s after halt"):
        rig.run(stop_profile(rig.port), 6000)
    assert rig.bits == HALT


def test_a_set_point_during_another_handshake_first_clears_bit_4() -> None:
    rig = Rig()
    old = move_profile(rig.port, 1.0, RATES)
    rig.run(old, 2)
    old.close()
    new = move_profile(rig.port, 2.0, RATES)
    low = 0
    for _ in range(20):
        rig.run(new, 1)
        if rig.bits & NEW_SET_POINT:
            break
        low += 1
    assert low >= 4
    assert rig.views.target_position[0] == 2.0


def test_noise_of_an_estimated_velocity_is_not_a_motion() -> None:
    rig = Rig()
    coarse = AxisPort(
        rig.views,
        0,
        AxisFacts("left", AxisUnits(1000), PERIOD, PERIOD, measures_velocity=False),
        write=rig.write,  # type: ignore[arg-type]
        put_rate=lambda name, value: False,
    )
    rig.views.actual_velocity[0] = 2 * 6.28  # two counts in a cycle
    assert coarse.at_rest
    assert not rig.port.at_rest
