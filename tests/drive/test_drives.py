"""Drives as a process-data request: objects, tables, arrays and state requests."""

import math
import warnings
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from catenary.core import state_of
from catenary.drive import Drives
from catenary.drive.objects import AxisObject
from catenary.errors import ConfigurationError, MappingError
from catenary.plan.cycle import AxisLimits, Bank
from catenary.plan.stop_reason import StopReason
from catenary.wire.cia402 import AxisState, Mode
from tests.drive.fakes import FakeLayout, fake_sub, views_of

MILLISECOND = 1_000_000


@pytest.fixture(autouse=True)
def _no_warning_of_the_default_velocity() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no velocity_limit", UserWarning)
        yield


def opened(drives: Drives) -> Drives:
    """Return drives that are bound to new arrays, as by a Loop."""
    tables = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND))))
    drives.bind(views_of(tables))
    return drives


def test_csp_requests_only_the_objects_it_needs() -> None:
    request = Drives([fake_sub(3)], counts_per_turn=2**20).pdos(MILLISECOND)[3]
    assert [r.index for r in request.outputs] == [0x6040, 0x6060, 0x607A]
    assert [r.index for r in request.inputs] == [0x6041, 0x6061, 0x6064, 0x606C, 0x6077]
    assert [r.bit_length for r in request.outputs] == [16, 8, 32]


def test_the_interpolation_time_follows_the_period() -> None:
    start_up = Drives([fake_sub(3)], counts_per_turn=1).pdos(250_000)[3].start_up
    assert start_up == ((0x60C2, 1, b"\xfa"), (0x60C2, 2, b"\xfa"))


def test_an_interpolation_time_that_agrees_is_not_written() -> None:
    assert Drives([fake_sub(3)], counts_per_turn=1).pdos(2_000_000)[3].start_up == ()


def test_a_drive_without_interpolation_time_gets_none() -> None:
    sub = fake_sub(3, {(0x6076, 0): 640})
    assert Drives([sub], counts_per_turn=1).pdos(MILLISECOND)[3].start_up == ()


def test_a_period_that_0x60c2_cannot_represent_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="0x60C2"):
        Drives([fake_sub(3)], counts_per_turn=1).pdos(333_333)


def test_a_drive_without_rated_torque_needs_the_option() -> None:
    sub = fake_sub(3, {})
    for asked in (
        {"mode": "cst", "velocity_limit": 1.0},
        {"measured": ["torque"]},
        {"torque_limit": 1.0},
    ):
        with pytest.raises(ConfigurationError, match="rated_torque="):
            Drives([sub], counts_per_turn=1, **asked).pdos(MILLISECOND)
    assert Drives([sub], counts_per_turn=1, measured=["position"]).pdos(MILLISECOND)
    assert Drives([sub], counts_per_turn=1, rated_torque=2.0).pdos(MILLISECOND)


def test_without_a_rated_torque_the_torque_is_absent() -> None:
    drives = Drives([fake_sub(3, {})], counts_per_turn=1)
    (axis,) = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND)))).axes
    assert axis.actual_torque is None
    assert axis.actual_velocity is not None


def test_optional_objects_are_not_required() -> None:
    def required(drives: Drives) -> list[int]:
        request = drives.pdos(MILLISECOND)[3]
        return [r.index for r in request.outputs + request.inputs if r.required]

    assert required(Drives([fake_sub(3)], counts_per_turn=1)) == [0x6040, 0x607A, 0x6041, 0x6064]
    switching = Drives(
        [fake_sub(3)],
        counts_per_turn=1,
        other_modes=["csv"],
        measured=["velocity"],
        velocity_limit=1.0,
    )
    assert required(switching) == [0x6040, 0x6060, 0x607A, 0x60FF, 0x6041, 0x6061, 0x606C]


def test_the_mode_is_written_once_where_the_drive_has_it() -> None:
    sub = fake_sub(3, {(0x6076, 0): 640, (0x6060, 0): 1})
    assert Drives([sub], counts_per_turn=1).pdos(MILLISECOND)[3].start_up == ((0x6060, 0, b"\x08"),)


def test_each_slot_is_an_axis() -> None:
    values = {(0x6076, 0): 640, (0x6876, 0): 1280, (0x685A, 0): 2}
    sub = fake_sub(2, values)
    drives = Drives(
        [(sub, 0), (sub, 1)], counts_per_turn=2**20, mode=["csp", "cst"], velocity_limit=3.0
    )
    request = drives.pdos(MILLISECOND)[2]
    assert [r.index for r in request.outputs] == [0x6040, 0x6060, 0x607A, 0x6840, 0x6860, 0x6871]
    first, second = drives.tables(FakeLayout.of({2: request})).axes
    assert (first.slot, second.slot) == (0, 1)
    assert first.target_torque is None
    assert second.target_torque is not None
    assert second.target_torque.scale == pytest.approx(1.28e-3)
    assert (first.mode, second.mode) == (8, 10)


def test_all_slots_of_a_device_are_taken_when_none_is_named() -> None:
    values = {(0x6076, 0): 640, (0x6876, 0): 640}
    drives = Drives([fake_sub(2, values, slots=(0, 1)), fake_sub(3)], counts_per_turn=1)
    assert len(drives) == 3
    assert drives.names == ("2 Servo", "2 Servo slot 1", "3 Servo")


def test_other_modes_map_their_targets() -> None:
    drives = Drives([fake_sub(3)], counts_per_turn=1, other_modes=["cst"], velocity_limit=3.0)
    assert 0x6071 in [r.index for r in drives.pdos(MILLISECOND)[3].outputs]
    opened(drives).switch("cst")
    assert drives.target.mode.tolist() == [Mode.CST]
    with pytest.raises(ValueError, match="other_modes"):
        drives.switch("csv")


def test_limits_reach_the_plan() -> None:
    drives = Drives(
        [fake_sub(3), fake_sub(4)],
        counts_per_turn=1,
        position_min=[-1.0, None],
        position_max=[1.0, None],
        velocity_limit=3.0,
        torque_limit=0.5,
    )
    tables = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND))))
    assert tables.axes[0].limits == AxisLimits(-1.0, 1.0, 3.0, 0.5)
    assert tables.axes[1].limits == AxisLimits(None, None, 3.0, 0.5)


@pytest.mark.parametrize(
    "wrong",
    [
        {"position_min": 1.0, "position_max": -1.0},
        {"velocity_limit": 0.0},
        {"torque_limit": math.nan},
        {"mode": "ip"},
        {"measured": ["power"]},
        {"columns": ["no_such_thing"]},
        {"gear_ratio": [1.0, 2.0]},
    ],
)
def test_invalid_options_are_refused_before_anything_is_sent(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong)).split("_")[0]):
        Drives([fake_sub(3)], **{"counts_per_turn": 1, **wrong})  # type: ignore[arg-type]


def test_an_axis_given_twice_is_refused() -> None:
    with pytest.raises(ValueError, match="twice"):
        Drives([fake_sub(3), fake_sub(3)], counts_per_turn=1)
    with pytest.raises(ValueError, match="no axes"):
        Drives([], counts_per_turn=1)


def test_columns_are_one_array_for_all_axes() -> None:
    drives = Drives(
        [fake_sub(1), fake_sub(2)],
        counts_per_turn=2**10,
        columns=[
            "following_error",
            "digital_inputs",
            "torque_offset",
            ("heat", AxisObject(0x2030, 1, 8)),
        ],
    )
    tables = drives.tables(FakeLayout.of(dict(drives.pdos(MILLISECOND))))
    assert [c.name for c in tables.input_columns][:2] == [
        "1 Servo.following_error",
        "2 Servo.following_error",
    ]
    assert [c.bank for c in tables.input_columns] == [Bank.REAL] * 2 + [Bank.INTEGER] * 4
    views = views_of(tables)
    drives.bind(views)
    views.input_integers[:] = [1, 2, 3, 4]
    assert drives.actual["digital_inputs"].tolist() == [1, 2]
    assert drives.actual["heat"].tolist() == [3, 4]
    drives.target["torque_offset"][:] = [0.5, 0.25]
    assert views.output_reals.tolist() == [0.5, 0.25]
    with pytest.raises(KeyError, match="heat"):
        drives.actual["cold"]


def test_an_object_that_is_not_mapped_is_named() -> None:
    drives = Drives([fake_sub(3)], counts_per_turn=1)
    with pytest.raises(MappingError, match="0x6040"):
        drives.tables(FakeLayout())


def test_values_exist_only_while_a_loop_is_open() -> None:
    drives = Drives([fake_sub(3)], counts_per_turn=1)
    with pytest.raises(AttributeError, match="before a Loop is open"):
        _ = drives.actual.position
    with pytest.raises(RuntimeError, match="before a Loop is open"):
        drives.enable()
    actual = drives.actual
    opened(drives)
    assert actual.position.shape == (1,)


def test_replacing_a_target_array_is_refused() -> None:
    drives = opened(Drives([fake_sub(3)], counts_per_turn=1))
    with pytest.raises(AttributeError, match=r"\[:\]"):
        drives.target.position = np.ones(1)  # type: ignore[misc]


def test_states_and_faults_are_read_from_the_cycle() -> None:
    drives = opened(Drives([fake_sub(1), fake_sub(2), fake_sub(3)], counts_per_turn=1))
    views = drives._views
    assert views is not None
    views.axis_state[:] = [
        AxisState.OPERATION_ENABLED,
        AxisState.FAULT,
        AxisState.FAULT_REACTION_ACTIVE,
    ]
    views.axis_flags[:] = [1, 0, 2]
    assert drives.state[0] is AxisState.OPERATION_ENABLED
    assert drives.faults == (1, 2)
    assert drives.enabled.tolist() == [True, False, False]
    assert drives.limited.tolist() == [False, False, True]


def test_an_axis_of_an_absent_device_is_not_enabled() -> None:
    drives = opened(Drives([fake_sub(1), fake_sub(2)], counts_per_turn=1, required=False))
    views = drives._views
    assert views is not None
    views.axis_flags[:] = 1
    views.unit_valid[2] = 0  # a sync unit per device in the fake layout
    assert drives.present.tolist() == [True, False]
    assert drives.enabled.tolist() == [True, False]


def test_the_reason_for_a_stop_is_kept() -> None:
    drives = opened(Drives([fake_sub(1), fake_sub(2)], counts_per_turn=1))
    views = drives._views
    assert views is not None
    views.stop_reason[:] = [0, StopReason.UNDERRUN]
    assert drives.stopped == (None, StopReason.UNDERRUN)


def test_the_state_of_an_invalid_statusword_is_none() -> None:
    drives = opened(Drives([fake_sub(1), fake_sub(2)], counts_per_turn=1))
    assert drives._views is not None
    drives._views.axis_state[:] = [state_of(0x0022), AxisState.FAULT]  # core: 255
    assert drives.state == (None, AxisState.FAULT)
    assert drives.faults == (1,)


def test_the_given_names_are_used() -> None:
    arm = Drives(
        [fake_sub(3), fake_sub(4)],
        counts_per_turn=1000,
        velocity_limit=1.0,
        names=["base", "elbow"],
    )
    assert arm.names == ("base", "elbow")


@pytest.mark.parametrize("names", [["base"], ["base", "base"], "ab"])
def test_every_axis_has_its_own_name(names: Sequence[str]) -> None:
    with pytest.raises(ValueError, match="name"):
        Drives([fake_sub(3), fake_sub(4)], counts_per_turn=1000, velocity_limit=1.0, names=names)
