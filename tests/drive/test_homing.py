"""Drives.home: homing in mode 6, and its errors."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import catenary as cat
from catenary.drive import HomingMethod
from catenary.drive.units import AxisUnits
from catenary.errors import DriveError
from catenary.virtual import Joint, Plant, Servo

COUNTS = 2**20


@contextmanager
def opened(
    *servos: Servo, run: str = "threaded", at: float = 0.0, **options: Any
) -> Iterator[tuple[cat.Drives, cat.Loop]]:
    segment = cat.Segment([cat.virtual.Coupler(), *servos])
    with cat.MainDevice(segment) as main:
        main.scan()
        for servo in servos:
            servo.move_to(at)
        arm = cat.Drives(
            main.subs.drives,
            **{
                "counts_per_turn": COUNTS,
                "velocity_limit": 100.0,
                "other_modes": ["hm"],
                **options,
            },
        )
        with cat.Loop(arm, period=1e-3, execution=run) as loop:
            yield arm, loop


@pytest.mark.parametrize("run", ["threaded", "inline"])
@pytest.mark.parametrize("mode", ["csp", "csv", "cst"])
def test_method_37_makes_the_present_position_home(run: str, mode: str) -> None:
    servos = Servo(), Servo()
    method = HomingMethod(37)
    with opened(*servos, run=run, mode=mode, homing=method, at=0.5) as (arm, loop):
        for cycle in loop:
            if cycle.number > 100:
                break
        assert arm.actual.position == pytest.approx(0.5, abs=0.05)
        loop.wait(arm.home())
        assert arm.actual.position == pytest.approx(0.0, abs=1e-3)
        assert arm.actual.mode.tolist() == [{"csp": 8, "csv": 9, "cst": 10}[mode]] * 2
        assert arm.enabled.all()


def test_an_offset_in_radians_and_one_axis_alone() -> None:
    homing = [HomingMethod(37, offset=-0.3), None]
    with opened(Servo(), Servo(), homing=homing, gear_ratio=10.0, direction=-1) as (arm, loop):
        loop.wait(arm.home(0))
        assert arm.actual.position == pytest.approx([0.3, 0.0], abs=1e-3)
        for _ in range(20):
            next(loop)
        assert arm.target.position == pytest.approx([0.3, 0.0], abs=1e-3)


def test_a_method_that_the_drive_lacks() -> None:
    with opened(Servo(name="Left"), homing=HomingMethod(5)) as (arm, loop):
        with pytest.raises(DriveError, match=r"1 Left reports a homing error .*bit 13"):
            loop.wait(arm.home())
        for _ in range(20):
            next(loop)
        assert arm.actual.mode.tolist() == [8]
        assert arm.enabled.all()


STOPS = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body>
      <joint name="finger" axis="0 0 1" range="-0.7 0.4"/>
      <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" mass="0.1"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(("method", "stop"), [(-3, 0.4), (-4, -0.7)])
def test_homing_against_a_hard_stop(tmp_path: Path, method: int, stop: float) -> None:
    (tmp_path / "finger.xml").write_text(STOPS)
    plant = Plant(tmp_path / "finger.xml", [Joint("finger", gear=10.0)])
    segment = cat.Segment([Servo(rated_torque=0.5)], plant=plant)
    homing = HomingMethod(method, speed=1.0, acceleration=10.0)
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives,
            counts_per_turn=COUNTS,
            velocity_limit=100.0,
            gear_ratio=10.0,
            other_modes=["hm"],
            homing=homing,
        )
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.home())
            assert arm.actual.position[0] == pytest.approx(0.0, abs=0.01)
            assert segment.plant.data.qpos[0] == pytest.approx(stop, abs=0.02)


def test_homing_fails_without_a_stop() -> None:
    method = HomingMethod(-3, speed=2.0, acceleration=20.0)
    with opened(Servo(name="Left"), homing=method) as (arm, loop):
        with pytest.raises(DriveError, match=r"1 Left was still moving after 0\.5 s"):
            loop.wait(arm.home(), timeout=0.5)
        for _ in range(400):
            next(loop)
        assert arm.actual.mode.tolist() == [8]
        assert arm.actual.velocity == pytest.approx(0.0, abs=0.01)
        assert arm.actual.position[0] == pytest.approx(1.0, abs=0.3)


def test_a_torque_off_during_homing_ends_it() -> None:
    servo = Servo(name="Left")
    with opened(servo, homing=HomingMethod(-3)) as (arm, loop):
        servo.switch_sto(True)
        with pytest.raises(DriveError, match="left OPERATION_ENABLED by itself: 1 Left"):
            loop.wait(arm.home())


def test_homing_needs_the_mode() -> None:
    with opened(Servo(), other_modes=[]) as (arm, _), pytest.raises(ValueError, match="'hm'"):
        arm.home()


def test_the_settings_are_written_in_counts() -> None:
    """0x6098, 0x607C, 0x6099:01 and :02, 0x609A of slot 1, in counts after a gear of 2."""
    method = HomingMethod(-4, speed=1.0, slow=0.5, acceleration=10.0, offset=0.25)
    per_radian = 2000 / (2 * 3.141592653589793) * 2
    assert method.downloads(AxisUnits(2000, 2.0), 0x800) == (
        (0x6898, 0, b"\xfc"),
        (0x687C, 0, round(0.25 * per_radian).to_bytes(4, "little")),
        (0x6899, 1, round(per_radian).to_bytes(4, "little")),
        (0x6899, 2, round(0.5 * per_radian).to_bytes(4, "little")),
        (0x689A, 0, round(10 * per_radian).to_bytes(4, "little")),
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": 200}, "method=200"),
        ({"speed": 0.0}, "speed=0.0"),
        ({"acceleration": -1.0}, "acceleration=-1.0"),
        ({"offset": float("nan")}, "offset=nan"),
    ],
)
def test_an_invalid_method_is_refused(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HomingMethod(**options)
