"""Reactions of a drive: option codes from PRE-OP, and CST with a quick stop that may not brake."""

import pytest

import catenary as cat
from catenary.drive import Drives
from catenary.drive.settings import DriveSettings, read_settings
from catenary.errors import ConfigurationError
from catenary.plan.stop_reason import TEXTS, StopReason
from catenary.types import INT
from tests.drive import fakes
from tests.drive.fakes import FakeLayout, fake_sub

MILLISECOND = 1_000_000


def lines(**codes: int) -> tuple[str, ...]:
    return DriveSettings(**codes).reactions()


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0, "quick stop: disable the drive function, the motor coasts (0x605A = 0)"),
        (
            2,
            "quick stop: slow down on the quick stop ramp, then SWITCH ON DISABLED (0x605A = 2)",
        ),
        (
            6,
            "quick stop: slow down on the quick stop ramp, stay in QUICK STOP ACTIVE (0x605A = 6)",
        ),
        (-3, "quick stop: manufacturer-specific (0x605A = -3)"),
        (9, "quick stop: reserved code (0x605A = 9)"),
    ],
)
def test_the_text_of_a_quick_stop(code: int, text: str) -> None:
    assert lines(quick_stop=code)[0] == text


def test_the_text_of_the_other_reactions() -> None:
    assert lines(disable_operation=1, fault_reaction=2, abort_connection=3) == (
        "quick stop: unknown (0x605A cannot be read)",
        "disable operation: slow down on the slow down ramp, then disable the drive function "
        "(0x605C = 1)",
        "fault: slow down on the quick stop ramp (0x605E = 2)",
        "watchdog expired: quick stop (0x6007 = 3)",
    )


def test_only_a_known_ramp_brakes() -> None:
    known = [code for code in range(-2, 12) if DriveSettings(quick_stop=code).brakes]
    assert known == [1, 2, 3, 4, 5, 6, 7, 8]
    assert not DriveSettings().brakes


def test_each_slot_and_device_has_its_own_settings() -> None:
    sub = fake_sub(1, {(0x605A, 0): 2, (0x685A, 0): 6, (0x6885, 0): 77, (0x6807, 0): 1})
    other = fake_sub(2, {(0x605A, 0): -1})
    assert read_settings([(sub, 0), (sub, 1), (other, 0)]) == [
        DriveSettings(quick_stop=2),
        DriveSettings(quick_stop=6, quick_stop_deceleration=77, abort_connection=1),
        DriveSettings(quick_stop=-1),
    ]


def test_an_object_of_another_size_is_unreadable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fakes, "size_of", lambda index: 3)
    assert read_settings([(fake_sub(1, {(0x605A, 0): 2}), 0)]) == [DriveSettings()]


def test_settings_over_frames_are_the_same() -> None:
    """The settings of two axes of a virtual servo, read over frames."""
    with cat.MainDevice(cat.Segment([cat.virtual.Servo(axes=2), cat.virtual.Servo()])) as main:
        first, second = main.scan()
        first.sdo.write(0x685A, 0, 6, type=INT)
        found = read_settings([(first, 0), (first, 1), (second, 0)])
    assert [each.quick_stop for each in found] == [2, 6, 2]
    assert {each.abort_connection for each in found} == {1}
    assert all(each.quick_stop_deceleration for each in found)


@pytest.mark.parametrize(
    ("code", "found"), [(0, "is 0, .*without braking"), (-1, "is -1"), (None, "cannot be read")]
)
def test_cst_needs_a_reaction_where_a_quick_stop_does_not_brake(
    code: int | None, found: str
) -> None:
    values = {(0x6076, 0): 640} | ({} if code is None else {(0x605A, 0): code})
    options = {"counts_per_turn": 1, "velocity_limit": 1.0}
    for modes in ({"mode": "cst"}, {"mode": "csp", "other_modes": ["cst"]}):
        drives = Drives([fake_sub(3, values)], **options, **modes)  # type: ignore[arg-type]
        with pytest.raises(ConfigurationError, match=f"3 Servo: .*0x605A {found}") as caught:
            drives.pdos(MILLISECOND)
        assert 'on_loss="quick_stop"' in caught.value.hint
    for reaction in ("quick_stop", "disable", "csp_hold"):
        assert Drives(
            [fake_sub(3, values)],
            **options,  # type: ignore[arg-type]
            mode="cst",
            on_loss=reaction,  # type: ignore[arg-type]
        ).pdos(MILLISECOND)
    csv = Drives([fake_sub(3, values)], **options, mode="csv")  # type: ignore[arg-type]
    assert csv.pdos(MILLISECOND)


def test_a_refused_axis_is_read_again() -> None:
    values = {(0x6076, 0): 640, (0x605A, 0): 0}
    drives = Drives([fake_sub(3, values)], counts_per_turn=1, mode="cst", velocity_limit=1.0)
    with pytest.raises(ConfigurationError):
        drives.pdos(MILLISECOND)
    values[0x605A, 0] = 2
    assert drives.pdos(MILLISECOND)


def test_each_plan_reads_the_drive_once() -> None:
    values = {(0x6076, 0): 640, (0x605A, 0): 2}
    drives = Drives([fake_sub(3, values)], counts_per_turn=1, velocity_limit=1.0)
    requests = dict(drives.pdos(MILLISECOND))
    values[0x605A, 0] = 6
    drives.pdos(MILLISECOND)
    layout = FakeLayout.of(requests)
    assert "0x605A = 2" in str(drives.tables(layout).axis_reports)
    drives.pdos(MILLISECOND)
    assert "0x605A = 6" in str(drives.tables(layout).axis_reports)


def test_csp_hold_maps_the_position_and_the_mode() -> None:
    def required(**options: object) -> list[int]:
        drives = Drives([fake_sub(3)], counts_per_turn=1, velocity_limit=1.0, **options)  # type: ignore[arg-type]
        request = drives.pdos(MILLISECOND)[3]
        return [r.index for r in request.outputs + request.inputs if r.required]

    assert required(mode="cst") == [0x6040, 0x6071, 0x6041, 0x6064]
    hold = [0x6040, 0x6060, 0x6071, 0x607A, 0x6041, 0x6061, 0x6064]
    assert required(mode="cst", on_loss="csp_hold") == hold
    alone = required(mode="cst", on_loss="csp_hold", measured=["torque"])
    assert alone == [0x6040, 0x6060, 0x6071, 0x607A, 0x6041, 0x6061, 0x6077, 0x6064]


def test_demand_values_are_used_where_they_are_mapped_and_never_requested() -> None:
    drives = Drives([fake_sub(3)], counts_per_turn=1, velocity_limit=1.0, other_modes=["cst"])
    requests = dict(drives.pdos(MILLISECOND))
    assert not {0x6062, 0x6074} & {r.index for r in requests[3].inputs}
    layout = FakeLayout.of(requests)
    (axis,) = drives.tables(layout).axes
    assert (axis.position_demand, axis.torque_demand) == (None, None)
    layout.inputs[3] |= {(0x6062, 0): 32, (0x6074, 0): 16}
    drives.pdos(MILLISECOND)
    (axis,) = drives.tables(layout).axes
    assert axis.position_demand is not None
    assert axis.torque_demand is not None
    assert axis.torque_demand.scale == pytest.approx(0.64e-3)


def test_the_velocity_offset_is_used_only_as_a_column() -> None:
    for columns in ([], ["velocity_offset"]):
        drives = Drives([fake_sub(3)], counts_per_turn=1, velocity_limit=1.0, columns=columns)
        layout = FakeLayout.of(dict(drives.pdos(MILLISECOND)))
        layout.outputs[3][0x60B1, 0] = 32
        (axis,) = drives.tables(layout).axes
        assert (axis.velocity_offset is not None) is bool(columns)


def test_every_reason_has_a_text() -> None:
    assert set(TEXTS) == set(StopReason)
