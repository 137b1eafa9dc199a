"""SERCOS drives as axes of `Drives`: telegrams, operation mode, scaling, limits, faults."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, DriveError, SoeError
from catenary.types import UINT
from catenary.virtual import Coupler, Segment, SercosDrive, Servo, SoeQuirks
from catenary.wire.cia402 import AxisState

TURN = 1 << 20
RPM = 2 * math.pi / 60
SI = {"counts_per_turn": TURN, "velocity_limit": 20.0}


class Bench:
    """Line of a coupler and drives; drive 1 is a SERCOS drive."""

    def __init__(self, drives: Sequence[SercosDrive | Servo]) -> None:
        self.drive = drives[0]
        self.segment = Segment([Coupler(), *drives])
        self.main = cat.MainDevice(self.segment)

    @property
    def soe(self) -> cat.Soe:
        return self.main.subs[1].soe

    def drives(self, **options: object) -> cat.Drives:
        return cat.Drives(self.main.subs.drives, **{**SI, **options})  # type: ignore[arg-type]


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench([SercosDrive()])
    with made.main:
        made.main.scan()
        yield made


def run(loop: cat.Loop, cycles: int) -> None:
    for _ in range(cycles):
        next(loop)


# -- modes and telegrams ----------------------------------------------------------------------


def test_a_position_is_reached(bench: Bench) -> None:
    arm = bench.drives()
    with cat.Loop(arm, period=1e-3) as loop:
        assert arm.state == (AxisState.OPERATION_ENABLED,)
        loop.wait(arm.move_to(1.0), timeout=5)
        assert bench.drive.position_rad == pytest.approx(1.0, abs=1e-3)
        assert arm.actual.position[0] == pytest.approx(1.0, abs=1e-3)
        assert bench.soe.request("S-0-0002").done is False
    assert bench.soe.read("S-0-0001") == 1000


def test_a_velocity_needs_other_telegrams_and_another_mode(bench: Bench) -> None:
    arm = bench.drives(mode="csv")
    plan = bench.main.plan(arm)
    assert bench.drive.idn_value("S-0-0032") == b"\x0b\x00"  # a plan writes nothing
    assert bench.drive.idn_value("S-0-0024")[4:] == b"\x2f\x00"
    assert [each.number for each in plan.devices[1].telegrams[0].outputs] == [134, 47, 36]
    with cat.Loop(arm, period=1e-3) as loop:
        for _ in range(300):
            next(loop)
            arm.target.velocity[:] = 5.0
        assert bench.drive.velocity_rad_s == pytest.approx(5.0, rel=0.01)
        assert arm.actual.velocity[0] == pytest.approx(5.0, rel=0.01)
    assert bench.drive.idn_value("S-0-0032") == b"\x02\x00"
    assert [each.number for each in bench.main.subs[1].description.sercos_axes[0].inputs] == [
        135,
        51,
        40,
        84,
    ]


@pytest.mark.parametrize(
    ("found", "written"), [(0x0003, 0x0003), (0x000B, 0x000B), (0x0013, 0x000B), (0x8003, 0x000B)]
)
def test_the_drive_must_not_compute_the_motion(bench: Bench, found: int, written: int) -> None:
    """0x0013: interpolation by an IndraDrive. 0x8003: telegrams of an AX5000 that change."""
    bench.soe.write("S-0-0032", found)
    with cat.Loop(bench.drives(), period=1e-3) as loop:
        next(loop)
        assert bench.drive.idn_value("S-0-0032") == written.to_bytes(2, "little")


def test_a_limit_in_the_telegram_is_refused(bench: Bench) -> None:
    """Without a program that writes it, the torque limit would be 0."""
    assert isinstance(bench.drive, SercosDrive)
    bench.drive.application.telegrams.lists = {True: (47, 92), False: (51,)}
    bench.main.scan()
    with pytest.raises(ConfigurationError, match="MDT contains S-0-0092"):
        bench.main.plan(bench.drives())


def test_a_torque_in_percent_of_the_rated_torque(bench: Bench) -> None:
    arm = bench.drives(mode="cst", rated_torque=2.0)
    with cat.Loop(arm, period=1e-3) as loop:
        for _ in range(100):
            next(loop)
            arm.target.torque[:] = 0.1
        assert bench.drive.idn_value("S-0-0032") == b"\x01\x00"
        assert bench.drive.idn_value("S-0-0080") == (50).to_bytes(2, "little")
        assert arm.actual.torque[0] == pytest.approx(0.1, abs=0.01)
        assert bench.drive.velocity_rad_s > 1.0


def test_columns_of_a_sercos_drive(bench: Bench) -> None:
    arm = bench.drives(columns=["velocity_offset", "following_error"])
    with cat.Loop(arm, period=1e-3) as loop:
        arm.target["velocity_offset"] = 0.5
        run(loop, 5)
        assert bench.drive.idn_value("S-0-0037") == round(0.5 / RPM * 1e4).to_bytes(4, "little")
        assert arm.actual["following_error"].shape == (1,)


def test_present_telegrams_are_kept_if_they_suffice(bench: Bench) -> None:
    bench.soe.configure_telegrams(mdt=["S-0-0081", "S-0-0047"], at=["S-0-0084", "S-0-0051"])
    arm = bench.drives(rated_torque=2.0)
    assert bench.main.plan(arm).devices[1].telegrams == ()
    with cat.Loop(arm, period=1e-3) as loop:
        loop.wait(arm.move_to(0.2), timeout=5)
        assert bench.drive.position_rad == pytest.approx(0.2, abs=1e-3)


def test_a_standard_telegram_is_replaced(bench: Bench) -> None:
    bench.soe.write("S-0-0015", 2)  # velocity control
    bench.main.scan()
    arm = bench.drives()
    with cat.Loop(arm, period=1e-3) as loop:
        loop.wait(arm.move_to(0.2), timeout=5)
    assert bench.soe.read("S-0-0015") == 7


def test_another_program_may_follow_with_process_data(bench: Bench) -> None:
    """The description contains the telegrams that the axis needed."""
    with cat.Loop(bench.drives(mode="csv"), period=1e-3) as loop:
        next(loop)
    raw = cat.ProcessData(bench.main.subs[1])
    with cat.Loop(raw, period=1e-3) as loop:
        next(loop)
        assert int(raw["S-0-0135"]) >> 14 == 2


def test_a_mixed_arm() -> None:
    made = Bench([SercosDrive(), Servo()])
    with made.main:
        made.main.scan()
        arm = made.drives()
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_to([0.5, -0.5]), timeout=5)
            assert arm.actual.position == pytest.approx([0.5, -0.5], abs=1e-3)


# -- scaling, polarity, limits ----------------------------------------------------------------


def test_gear_direction_and_offset_apply(bench: Bench) -> None:
    arm = bench.drives(gear_ratio=10.0, direction=-1, offset=0.3)
    with cat.Loop(arm, period=1e-3) as loop:
        loop.wait(arm.move_to(0.5), timeout=5)
        assert bench.drive.position_rad == pytest.approx(-2.0, abs=1e-2)


def test_preferred_scalings() -> None:
    """0.0001 degrees, and 0.0001 rpm."""
    made = Bench([SercosDrive(resolution=3_600_000)])
    with made.main:
        made.main.scan()
        made.soe.write("S-0-0076", 0x0002)
        with cat.Loop(made.drives(counts_per_turn=3_600_000), period=1e-3) as loop:
            next(loop)


def test_a_velocity_in_parameter_scaling(bench: Bench) -> None:
    """Factor 1, exponent -4 as before, but as parameters; then seconds instead of minutes."""
    for kind, unit in ((0x000A, 1e-4 * RPM), (0x002A, 1e-4 * 2 * math.pi)):
        bench.soe.write("S-0-0044", kind)
        bench.main.scan()
        [axis] = bench.main.plan(bench.drives(mode="csv")).cycle.axes
        assert axis.target_velocity is not None
        assert axis.target_velocity.scale == pytest.approx(unit)


def test_a_torque_in_newton_metres(bench: Bench) -> None:
    bench.soe.write("S-0-0086", 0x0002)
    bench.main.scan()
    [axis] = bench.main.plan(bench.drives(mode="cst")).cycle.axes
    assert axis.target_torque is not None
    assert axis.target_torque.scale == pytest.approx(0.01)
    assert axis.limits.torque == pytest.approx(3000 * 0.01)


@pytest.mark.parametrize(
    ("idn", "value", "expected"),
    [
        ("S-0-0043", 0b101, (-1, -1, 1, 1, 1, 1)),
        ("S-0-0085", 0b001, (1, 1, -1, 1, 1, 1)),
        ("S-0-0055", 0b101, (-1, -1, -1, -1, 1, 1)),
        ("S-0-0055", 0b001, (1, 1, 1, 1, -1, 1)),
    ],
)
def test_polarities_agree_with_the_position(
    bench: Bench, idn: str, value: int, expected: tuple[int, ...]
) -> None:
    """Velocity, its feedback, torque, its feedback, position, its feedback."""
    mdt, at = ["S-0-0036", "S-0-0047", "S-0-0080"], ["S-0-0040", "S-0-0051", "S-0-0084"]
    bench.soe.configure_telegrams(mdt=mdt, at=at)
    bench.soe.write(idn, value)
    bench.main.scan()
    [axis] = bench.main.plan(bench.drives(rated_torque=2.0)).cycle.axes
    numbers = (
        *(axis.target_velocity, axis.actual_velocity, axis.target_torque, axis.actual_torque),
        *(axis.target_position, axis.actual_position),
    )
    assert tuple(math.copysign(1, each.scale) for each in numbers if each) == expected


def test_limits_of_the_drive_tighten_the_options(bench: Bench) -> None:
    bench.soe.write("S-0-0091", 60.0)  # rpm
    bench.soe.write("S-0-0092", 150.0)  # %
    [axis] = bench.main.plan(bench.drives(rated_torque=2.0, torque_limit=10.0)).cycle.axes
    assert axis.limits.velocity == pytest.approx(2 * math.pi)
    assert axis.limits.torque == pytest.approx(3.0)
    [axis] = bench.main.plan(bench.drives(velocity_limit=1.0)).cycle.axes
    assert axis.limits.velocity == 1.0


@pytest.mark.parametrize(
    ("idn", "value", "message"),
    [
        ("S-0-0076", 0x0001, "linear scaling"),
        ("S-0-0076", 0x004A, "refers to the load"),
        ("S-0-0076", 0x008A, "modulo"),
        ("S-0-0076", 0x0002, "preferred scaling .* is 3600000"),
        ("S-0-0044", 0x0042, "refers to the load"),
        ("S-0-0086", 0x0001, "linear scaling"),
        ("S-0-0086", 0x0012, "in·lbf"),
        ("S-0-0032", 0x000C, "external encoder"),
        ("S-0-0032", 0x0005, "external encoder"),
    ],
)
def test_scalings_that_an_axis_cannot_use(bench: Bench, idn: str, value: int, message: str) -> None:
    bench.soe.write(idn, value)
    bench.main.scan()
    with pytest.raises(ConfigurationError, match=message):
        bench.main.plan(bench.drives())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"counts_per_turn": 131072}, "S-0-0079 is 1048576"),
        ({"velocity_unit": 1.0}, "velocity_unit=1"),
        ({"mode": "cst"}, "rated torque, which is unknown"),
        ({"measured": ["position", "torque"]}, "rated torque, which is unknown"),
        ({"mode": "pp"}, "mode='pp' needs CiA 402"),
        ({"other_modes": ["csv"]}, "other_modes= needs CiA 402"),
        ({"on_loss": "csp_hold"}, "csp_hold"),
        ({"touch_probe": True}, "touch_probe"),
        ({"pdos": [0x1600]}, "pdos="),
        ({"columns": ["digital_inputs"]}, "no column 'digital_inputs'"),
        ({"columns": {"x": (0x2000, 1, UINT)}}, "no column 'x'"),
    ],
)
def test_options_that_need_cia_402(bench: Bench, options: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        bench.main.plan(bench.drives(**options))


def test_a_period_that_the_drive_cannot_represent(bench: Bench) -> None:
    with (
        pytest.raises(ConfigurationError, match=r"S-0-0001 cannot represent 333\.3"),
        cat.Loop(bench.drives(), period=333.3e-6),
    ):
        pytest.fail("opened")


# -- faults -----------------------------------------------------------------------------------


def run_into_fault(bench: Bench) -> None:
    with cat.Loop(bench.drives(), period=1e-3) as loop:
        run(loop, 20)
        bench.drive.inject_fault(0x7310)
        run(loop, 100)


def test_a_fault_shows_the_diagnosis_of_the_drive(bench: Bench) -> None:
    shown = r"in fault: .*0x000F2000 \(S-0-0390\), 'F2000"
    with pytest.raises(DriveError, match=shown) as caught:
        run_into_fault(bench)
    assert "7310" in str(caught.value)


def test_a_new_loop_resets_the_fault(bench: Bench) -> None:
    bench.drive.inject_fault(0x7310)
    with pytest.raises(DriveError, match="cannot be enabled"), cat.Loop(bench.drives()):
        pytest.fail("entered with a drive in fault")
    bench.drive.inject_fault(0)
    with cat.Loop(bench.drives()) as loop:
        next(loop)
        assert bench.drive.status == "OPERATING"


@pytest.mark.parametrize("resets_first", [False, True])
def test_a_running_loop_resets_the_fault_on_request(bench: Bench, resets_first: bool) -> None:
    arm = bench.drives()
    with cat.Loop(arm, period=1e-3, stop=cat.StopPolicy(raise_faults=False)) as loop:
        run(loop, 20)
        bench.drive.inject_fault(0x7310)
        run(loop, 50)
        assert arm.faults == (0,)
        bench.drive.inject_fault(0)
        run(loop, 50)
        assert arm.faults == (0,)
        if resets_first:
            arm.reset_faults()
            run(loop, 100)
            assert arm.faults == ()
            assert bench.drive.status == "POWERED"
        arm.enable()
        run(loop, 100)
        assert bench.drive.status == "OPERATING"
        assert arm.enabled.all()


def test_a_recovery_resets_the_fault(bench: Bench) -> None:
    arm = bench.drives()
    recovery = cat.drive.Recovery(arm, after=0.2)
    with cat.Loop(arm, period=1e-3, stop=cat.StopPolicy(raise_faults=False)) as loop:
        for cycle in loop:
            if cycle.number == 50:
                bench.drive.inject_fault(0x7310)
            if cycle.number == 150:
                bench.drive.inject_fault(0)
            phase = recovery.step(cycle, "a fault" if arm.faults else None)
            if cycle.number > 60 and phase is cat.drive.Phase.RUNNING:
                break
            assert cycle.number < 3000
        assert bench.drive.status == "OPERATING"
    assert len(recovery.stops) == 1


def test_a_drive_that_cannot_run_the_reset_command() -> None:
    made = Bench([SercosDrive(soe_quirks=SoeQuirks(failing_commands=("S-0-0099",)))])
    with made.main:
        made.main.scan()
        made.drive.inject_fault(0x7310)
        with pytest.raises(DriveError, match="cannot be reset") as caught, cat.Loop(made.drives()):
            pytest.fail("entered with a drive in fault")
        assert isinstance(caught.value.__cause__, SoeError)


def test_mains_lost_and_back_needs_a_request(bench: Bench) -> None:
    arm = bench.drives()
    policy = cat.StopPolicy(raise_faults=False, on_axis_stopped="event")
    with cat.Loop(arm, period=1e-3, stop=policy) as loop:
        run(loop, 20)
        bench.drive.switch_mains(False)
        run(loop, 50)
        assert arm.state == (AxisState.SWITCH_ON_DISABLED,)
        bench.drive.switch_mains(True)
        run(loop, 200)
        assert bench.drive.status == "POWERED"
        arm.enable()
        run(loop, 50)
        assert bench.drive.status == "OPERATING"


def test_entering_without_mains_power_fails_with_a_hint(bench: Bench) -> None:
    bench.drive.switch_mains(False)
    with pytest.raises(DriveError, match="SWITCH_ON_DISABLED") as caught, cat.Loop(bench.drives()):
        pytest.fail("entered without power")
    assert "main supply" in caught.value.hint


def test_a_drive_that_returns_gets_telegrams_and_mode_back(bench: Bench) -> None:
    """It moves again only after a request."""
    arm = bench.drives(mode="csv", required=False)
    drive = bench.drive
    assert isinstance(drive, SercosDrive)
    telegrams = drive.application.telegrams
    policy = cat.StopPolicy(on_axis_stopped="event", raise_faults=False)
    with cat.Loop(arm, period=1e-3, stop=policy) as loop:
        for cycle in range(3000):
            next(loop)
            arm.target.velocity[:] = 2.0
            if cycle == 200:
                drive.power_off()
            if cycle == 400:
                telegrams.lists = {True: (47,), False: (51,)}  # defaults of the drive
                drive._sercos.parameters[32].content = b"\x0b\x00"
                drive.power_on()
            if cycle > 500 and arm.present.all():
                break
        assert arm.present.all()
        assert telegrams.lists == {True: (47, 36), False: (51, 40, 84)}
        assert drive.idn_value("S-0-0032") == b"\x02\x00"
        for _ in range(200):
            next(loop)
            arm.target.velocity[:] = 2.0
        assert drive.status == "POWERED"
        assert abs(drive.velocity_rad_s) < 0.1
        arm.enable()
        for _ in range(300):
            next(loop)
            arm.target.velocity[:] = 2.0
        assert drive.velocity_rad_s == pytest.approx(2.0, rel=0.05)


def stall(bench: Bench, arm: cat.Drives) -> None:
    """Let the program be late in an inline loop, until the watchdog of the drive expires."""
    with cat.Loop(arm, execution="inline") as loop:
        for cycle in loop:
            arm.target.velocity[:] = 5.0
            if cycle.number == 300:
                assert bench.drive.velocity_rad_s == pytest.approx(5.0, rel=0.05)
                cycle.spend(0.5)
            assert cycle.number < 320


def test_a_watchdog_brakes_the_drive_and_the_next_loop_resets_it(bench: Bench) -> None:
    arm = bench.drives(mode="csv")
    with pytest.raises(cat.CatenaryError):
        stall(bench, arm)
    assert abs(bench.drive.velocity_rad_s) < 0.05
    assert bench.drive.status == "NOT READY"
    with cat.Loop(arm) as loop:
        next(loop)
        assert arm.faults == ()
