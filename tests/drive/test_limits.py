"""Limits and reactions of an axis, from options, limits of the drive and defaults."""

import math
import warnings

import pytest

from catenary.drive import Drives
from catenary.drive.limits import LimitOptions, make_bounds
from catenary.drive.settings import DriveSettings, OwnLimits, own_limits
from catenary.drive.units import AxisUnits
from catenary.errors import ConfigurationError
from catenary.plan.cycle import AxisPlan
from catenary.wire.cia402 import Mode
from tests.drive.fakes import FakeLayout, fake_sub

MILLISECOND = 1_000_000
BRAKING = {(0x605A, 0): 2, (0x6076, 0): 1000}


def axis_of(values: dict[tuple[int, int], int] | None = None, **options: object) -> AxisPlan:
    given = {"counts_per_turn": 1000, "velocity_limit": 4.0, **options}
    drives = Drives([fake_sub(3, BRAKING if values is None else values)], **given)  # type: ignore[arg-type]
    (axis,) = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND)))).axes
    return axis


def test_csp_without_a_velocity_limit_warns_once_and_uses_a_turn_per_second() -> None:
    with pytest.warns(UserWarning, match="no velocity_limit for 1 Servo, 2 Servo") as caught:
        drives = Drives([fake_sub(1), fake_sub(2)], counts_per_turn=1)
    assert len(caught) == 1
    assert "Drives(velocity_limit=...)" in str(caught[0].message)
    assert caught[0].filename == __file__
    for axis in drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND)))).axes:
        assert axis.limits.velocity == pytest.approx(2 * math.pi)
        assert axis.limits.step is None


def test_a_velocity_limit_given_does_not_warn() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert axis_of().limits.velocity == 4.0


@pytest.mark.parametrize("options", [{"mode": "csv"}, {"mode": "cst"}, {"other_modes": ["cst"]}])
def test_csv_and_cst_require_a_velocity_limit(options: dict[str, object]) -> None:
    with pytest.raises(
        ValueError, match=r"3 Servo: velocity_limit= .*required in CS[VT].*math\.inf"
    ):
        Drives([fake_sub(3)], counts_per_turn=1, **options)  # type: ignore[arg-type]


def test_an_infinite_velocity_limit_means_no_limit() -> None:
    axis = axis_of(mode="csv", velocity_limit=math.inf, deceleration_limit=5.0)
    assert axis.limits.velocity is None
    assert (axis.deceleration, axis.acceleration) == (5.0, 5.0)


def test_csp_with_an_infinite_velocity_limit_needs_a_step_limit() -> None:
    with pytest.raises(ValueError, match="3 Servo: velocity_limit=inf in CSP needs step_limit="):
        axis_of(velocity_limit=math.inf, deceleration_limit=5.0)
    axis = axis_of(velocity_limit=math.inf, deceleration_limit=5.0, step_limit=0.2)
    assert axis.limits.step == 0.2


def test_an_infinite_velocity_limit_needs_a_deceleration() -> None:
    with pytest.raises(
        ConfigurationError, match=r"3 Servo: velocity_limit is infinite.*0x6085"
    ) as caught:
        axis_of(mode="cst", velocity_limit=math.inf)
    assert "deceleration_limit=" in caught.value.hint
    axis = axis_of({**BRAKING, (0x6085, 0): 1000}, mode="cst", velocity_limit=math.inf)
    assert axis.deceleration == pytest.approx(2 * math.pi)


@pytest.mark.parametrize(
    "option",
    [
        "velocity_limit",
        "torque_limit",
        "acceleration_limit",
        "deceleration_limit",
        "torque_slope",
        "step_limit",
    ],
)
@pytest.mark.parametrize("value", [math.nan, 0.0, -1.0])
def test_limits_must_be_positive(option: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"3 Servo: {option} must be positive"):
        axis_of(**{option: value})


@pytest.mark.parametrize(
    "option", ["acceleration_limit", "deceleration_limit", "torque_slope", "step_limit"]
)
def test_options_of_the_fallback_must_be_finite(option: str) -> None:
    with pytest.raises(ValueError, match=f"3 Servo: {option} must be finite"):
        axis_of(**{option: math.inf})


def test_other_invalid_options_are_refused() -> None:
    with pytest.raises(ValueError, match="position_min must be a number"):
        axis_of(position_min=math.nan)
    with pytest.raises(ValueError, match=r"3 Servo: position_min 1\.0 must be below"):
        axis_of(position_min=1.0, position_max=1.0)
    with pytest.raises(ValueError, match=r"on_loss='brake'; use one of 'quick_stop'"):
        axis_of(on_loss="brake")
    with pytest.raises(ValueError, match="on_loss has 1 values for 2 axes"):
        Drives([fake_sub(1), fake_sub(2)], counts_per_turn=1, on_loss=["disable"])


def test_the_deceleration_without_an_option() -> None:
    assert axis_of().deceleration == pytest.approx(16.0)  # 4 rad/s in 0.25 s
    assert axis_of(deceleration_limit=7.0).deceleration == 7.0
    counts = round(50 * 1000 / (2 * math.pi))
    assert axis_of({(0x6085, 0): counts}).deceleration == pytest.approx(50, rel=1e-3)
    for implausible in (0, 2**32 - 1, 2**31 - 1, 1):  # the last one: brakes for minutes
        assert axis_of({(0x6085, 0): implausible}).deceleration == pytest.approx(16.0)


def test_the_options_reach_the_plan() -> None:
    axis = axis_of(
        mode="cst",
        acceleration_limit=3.0,
        deceleration_limit=9.0,
        torque_slope=2.0,
        on_loss="disable",
    )
    assert (axis.acceleration, axis.deceleration, axis.torque_slope) == (3.0, 9.0, 2.0)
    assert axis.on_loss == "disable"


def test_a_value_for_each_axis() -> None:
    drives = Drives(
        [fake_sub(1), fake_sub(2)],
        counts_per_turn=1,
        velocity_limit=[1.0, 2.0],
        step_limit=[None, 0.3],
        on_loss=["disable", None],
    )
    first, second = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND)))).axes
    assert (first.limits.velocity, second.limits.velocity) == (1.0, 2.0)
    assert (first.limits.step, second.limits.step) == (None, 0.3)
    assert (first.on_loss, second.on_loss) == ("disable", "quick_stop")


# The drive's own limits

UNITS = AxisUnits(1000, rated_torque=1.0)


def test_software_position_limits_are_corrected_by_the_home_offset() -> None:
    settings = DriveSettings(position_min=-250, position_max=500, home_offset=250)
    own = own_limits(settings, UNITS)
    assert own.position_min == pytest.approx(-math.pi)
    assert own.position_max == pytest.approx(math.pi / 2)
    turned = own_limits(settings, AxisUnits(1000, direction=-1, offset=1.0))
    assert turned.position_min == pytest.approx(1.0 - math.pi / 2)
    assert turned.position_max == pytest.approx(1.0 + math.pi)
    homed = own_limits(settings, UNITS, home_offset=0)
    assert homed.position_max == pytest.approx(math.pi)


@pytest.mark.parametrize(
    ("low", "high"), [(0, 0), (5, 5), (10, -10), (None, 3), (3, None), (-(2**31), 2**31 - 1)]
)
def test_position_limits_that_are_not_set(low: int | None, high: int | None) -> None:
    own = own_limits(DriveSettings(position_min=low, position_max=high), UNITS)
    assert (own.position_min, own.position_max) == (None, None)


def test_the_velocity_of_the_drive() -> None:
    speed = own_limits(DriveSettings(max_motor_speed=3000), AxisUnits(1000, gear_ratio=10.0))
    assert speed.velocity == pytest.approx(10 * math.pi)
    assert speed.velocity_source == "0x6080 of the drive"
    for implausible in (0, 2**32 - 1, 10_000_000, 5):
        assert own_limits(DriveSettings(max_motor_speed=implausible), UNITS).velocity is None
    profile = DriveSettings(max_profile_velocity=100)
    assert own_limits(profile, UNITS).velocity is None  # its unit is not known
    assert own_limits(profile, AxisUnits(1000, velocity_unit=0.1)).velocity == pytest.approx(10.0)


def test_the_torque_of_the_drive() -> None:
    assert own_limits(DriveSettings(max_torque=3000), UNITS).torque == pytest.approx(3.0)
    assert own_limits(DriveSettings(max_torque=0xFFFF), UNITS).torque is None
    assert own_limits(DriveSettings(max_torque=3000), AxisUnits(1)).torque is None


def test_the_limits_of_the_drive_only_tighten() -> None:
    own = OwnLimits(-2.0, 2.0, 3.0, "0x6080 of the drive", 1.0)
    tighter = LimitOptions(-1.0, 1.0, 2.0, 0.5)
    looser = LimitOptions(-3.0, 3.0, 30.0, 5.0)
    for options, expected, source in (
        (tighter, (-1.0, 1.0, 2.0, 0.5), "option"),
        (looser, (-2.0, 2.0, 3.0, 1.0), "0x6080 of the drive"),
    ):
        bounds = make_bounds("a", options, [Mode.CSV], own, AxisUnits(1))
        limits = bounds.limits
        found = (limits.position_min, limits.position_max, limits.velocity, limits.torque)
        assert found == expected
        assert bounds.velocity.source == source


def test_position_limits_that_contradict_the_options_are_ignored() -> None:
    own = OwnLimits(position_min=2.0, position_max=3.0)
    bounds = make_bounds("a", LimitOptions(-1.0, 1.0, 1.0), [Mode.CSP], own, AxisUnits(1))
    assert (bounds.position_min.value, bounds.position_max.value) == (-1.0, 1.0)
    assert "contradicts" in bounds.position_max.source


def test_the_default_velocity_is_not_raised_by_the_drive() -> None:
    fast = make_bounds("a", LimitOptions(), [Mode.CSP], OwnLimits(velocity=300.0), AxisUnits(1))
    slow = make_bounds("a", LimitOptions(), [Mode.CSP], OwnLimits(velocity=3.0), AxisUnits(1))
    assert fast.velocity.value == pytest.approx(2 * math.pi)
    assert slow.velocity.value == 3.0


# ---- linear axes


def test_a_linear_axis_has_defaults_and_messages_of_its_own() -> None:
    subs = [fake_sub(3, BRAKING), fake_sub(4, BRAKING)]
    with pytest.warns(UserWarning, match="no velocity_limit") as warned:
        drives = Drives(subs, counts_per_turn=1000, metres_per_turn=[0.01, None])
    texts = [str(each.message) for each in warned]
    assert "3 Servo: the default of 0.1 m/s" in texts[0]
    assert "4 Servo: the default of 6.28 rad/s" in texts[1]
    tables = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND))))
    linear, rotary = tables.axes
    assert (linear.limits.velocity, linear.standstill, linear.step_floor) == (0.1, 0.005, 0.005)
    assert (rotary.standstill, rotary.step_floor) == (0.05, 0.1)
    lines = "\n".join(tables.axis_reports[0].lines)
    assert "velocity 0.1 m/s (default)" in lines
    assert "step limit 0.005 m (default)" in lines
    assert "limits: force none" in lines


def test_a_force_limit_belongs_to_linear_axes_and_a_torque_limit_to_rotary_ones() -> None:
    both = [fake_sub(3), fake_sub(4)]
    drives = Drives(
        both,
        counts_per_turn=1000,
        velocity_limit=1.0,
        metres_per_turn=[0.01, None],
        force_limit=[60.0, None],
        torque_limit=[None, 2.0],
    )
    assert [axis.options.torque_limit for axis in drives._axes] == [60.0, 2.0]
    with pytest.raises(ValueError, match="axis 0, which is rotary; use torque_limit"):
        Drives(both, counts_per_turn=1000, velocity_limit=1.0, force_limit=60.0)
    with pytest.raises(ValueError, match="which is linear; use force_limit"):
        Drives(
            both, counts_per_turn=1000, velocity_limit=1.0, metres_per_turn=0.01, torque_limit=1.0
        )
    with pytest.raises(ValueError, match="force_limit must be positive"):
        Drives(
            both, counts_per_turn=1000, velocity_limit=1.0, metres_per_turn=0.01, force_limit=-1.0
        )


def test_the_motor_speed_limit_of_a_linear_axis_is_in_metres() -> None:
    units = AxisUnits(1000, gear_ratio=2.0, metres_per_turn=0.01)
    speed = own_limits(DriveSettings(max_motor_speed=6000), units)
    assert speed.velocity == pytest.approx(100 / 2 * 0.01)
