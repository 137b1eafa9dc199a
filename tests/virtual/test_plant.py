"""Plant, compared with formulas: pendulum, gears, inertia, friction, brakes and encoder."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from catenary.virtual import Coupler, Joint, Plant, Segment, Servo, _segment
from catenary.virtual.faults import exchange, power_cycle, safe_torque_off, swap
from tests.virtual.plants import (
    DOUBLE,
    GRAVITY,
    INERTIA,
    LENGTH,
    MASS,
    STEP,
    Time,
    frictionless,
    model,
    pendulum,
)

TURN = 2 * math.pi


def servo_of(segment: Segment, position: int = 0) -> Servo:
    servo = segment[position]
    assert isinstance(servo, Servo)
    return servo


def agm(a: float, b: float) -> float:
    """Return the arithmetic-geometric mean."""
    while abs(a - b) > 1e-14:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a


def test_pendulum_has_the_period_of_the_formula(tmp_path: Path) -> None:
    """T = 2 pi sqrt(l / g) / agm(1, cos(amplitude / 2)): exact for any amplitude."""
    amplitude = 0.8
    segment = pendulum(tmp_path, frictionless(), start=amplitude)
    servo, time = servo_of(segment), Time(segment)
    crossings: list[float] = []
    before = amplitude
    while len(crossings) < 5:
        time.pass_by(STEP)
        now = servo.position_rad
        if before * now < 0:
            crossings.append(segment.time - STEP * now / (now - before))
        before = now
        assert segment.time < 10
    period = (crossings[4] - crossings[0]) / 2
    expected = TURN * math.sqrt(LENGTH / GRAVITY) / agm(1.0, math.cos(amplitude / 2))
    assert period == pytest.approx(expected, rel=1e-4)


def test_free_pendulum_conserves_energy(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless(), start=1.0)
    servo, time = servo_of(segment), Time(segment)
    top = MASS * GRAVITY * LENGTH * (1 - math.cos(1.0))
    for _ in range(40):
        time.pass_by(0.05)
        kinetic = INERTIA * servo.velocity_rad_s**2 / 2
        energy = kinetic + MASS * GRAVITY * LENGTH * (1 - math.cos(servo.position_rad))
        assert energy == pytest.approx(top, rel=5e-3)


def test_viscous_friction_dissipates_energy(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless(viscous_friction=2.0), start=1.0)
    Time(segment).pass_by(10)
    assert abs(servo_of(segment).position_rad) < 1e-3


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("gear", [1.0, 50.0])
def test_gear_transforms_torque_and_motor_inertia(
    tmp_path: Path, gear: float, direction: int
) -> None:
    """From rest at the bottom: angle = torque t² / 2 J, J = joint + gear² · motor."""
    motor, torque, seconds = 2e-3, 0.5 / gear, 0.05
    segment = pendulum(tmp_path, frictionless(inertia=motor), gear=gear, direction=direction)
    servo, time = servo_of(segment), Time(segment)
    servo.apply_load(torque)
    time.pass_by(seconds)
    angle = 0.5 * gear * torque / (INERTIA + gear**2 * motor) * seconds**2
    assert segment.plant is not None
    joint = float(segment.plant.data.joint("swing").qpos[0])
    assert joint == pytest.approx(direction * angle, rel=0.01)
    assert servo.position_rad == pytest.approx(direction * gear * joint, rel=1e-12)


def test_encoder_counts_motor_turns_from_the_joint_zero(tmp_path: Path) -> None:
    segment = pendulum(
        tmp_path, frictionless(counts_per_turn=1000), gear=20.0, direction=-1, zero=0.3, brake=None,
        start=1.0,
    )  # fmt: skip
    Time(segment).pass_by(0.1)
    servo = servo_of(segment)
    counts = servo.core.slot(0, _segment.SLOT_POSITION)  # 0x6064
    assert counts == round(-20 * (1.0 - 0.3) / TURN * 1000)
    assert counts == round(servo.position_rad / TURN * 1000)


def test_dry_friction_holds_up_to_its_torque(tmp_path: Path) -> None:
    gear, dry = 10.0, 0.2  # 2 N·m at the joint
    segment = pendulum(tmp_path, frictionless(coulomb_friction=dry), gear=gear)
    servo, time = servo_of(segment), Time(segment)
    servo.apply_load(0.95 * dry)
    time.pass_by(1.0)
    assert abs(servo.position_rad) < gear * 1e-5
    servo.apply_load(1.5 * dry)
    time.pass_by(0.05)
    expected = 0.5 * 0.5 * dry * gear / INERTIA * 0.05**2
    assert servo.position_rad / gear == pytest.approx(expected, rel=0.03)


def test_brake_holds_without_power_and_slips_beyond_its_torque(tmp_path: Path) -> None:
    load = MASS * GRAVITY * LENGTH  # at 90 degrees
    for brake, holds in ((1.1 * load, True), (0.9 * load, False)):
        segment = pendulum(tmp_path, frictionless(), start=math.pi / 2, brake=brake)
        Time(segment).pass_by(0.5)
        assert (abs(servo_of(segment).position_rad - math.pi / 2) < 1e-5) is holds


def test_default_brake_torque_is_the_maximum_motor_torque(tmp_path: Path) -> None:
    """MASS g LENGTH = 9.81 N·m. A motor of 3 · 2 N·m holds it with a gear of 2, but not of 1.5."""
    for gear, holds in ((2.0, True), (1.5, False)):
        servo = frictionless(rated_torque=2.0, max_torque_ratio=3.0)
        segment = pendulum(tmp_path, servo, start=math.pi / 2, brake=None, gear=gear)
        Time(segment).pass_by(0.5)
        assert (abs(servo.position_rad / gear - math.pi / 2) < 1e-5) is holds


def test_axes_of_two_servos_drive_one_model(tmp_path: Path) -> None:
    """The holding torques equal those of gravity: m g x of the point masses."""
    text = DOUBLE.replace("</mujoco>", "").replace(
        "</worldbody>",
        """<body pos="0 0 2"><joint name="slide" type="slide" axis="0 0 1"/>
        <geom type="sphere" size=".02" mass="1.2"/></body></worldbody></mujoco>""",
    )
    servos = [frictionless(axes=2), frictionless()]
    joints = [
        Joint("slide", gear=4.0, brake=0),
        Joint("elbow", brake=0),
        Joint("shoulder", brake=0),
    ]
    segment = Segment(servos, plant=Plant(model(tmp_path, text), joints))
    time = Time(segment)
    upper, lower = 1.5 * GRAVITY * 0.4, 1.0 * GRAVITY
    servos[0].apply_load(1.2 * GRAVITY / 4.0, axis=0)
    servos[0].apply_load(-lower * 0.3, axis=1)
    servos[1].apply_load(-upper - lower * 0.7)
    time.pass_by(0.1)
    positions = [servos[0].axis_position(0), servos[0].axis_position(1), servos[1].position_rad]
    assert positions == pytest.approx([0, 0, 0], abs=1e-6)


def test_joint_range_is_a_hard_stop(tmp_path: Path) -> None:
    joints = [Joint("shoulder", brake=100.0), Joint("elbow", brake=0.0)]
    segment = Segment([Servo(axes=2)], plant=Plant(model(tmp_path, DOUBLE), joints))
    servo = servo_of(segment)
    servo.apply_load(5.0, axis=1)
    Time(segment).pass_by(2)
    assert servo.axis_position(1) == pytest.approx(2.0, abs=0.02)


def test_model_and_motors_step_together(tmp_path: Path) -> None:
    """One step every 250 us, none is skipped, also without frames."""
    segment = pendulum(tmp_path, frictionless())
    Time(segment).pass_by(1.0)
    assert segment.plant is not None
    assert segment.plant.steps == 4000
    assert segment.plant.data.time == pytest.approx(1.0)


def test_unpowered_drive_is_turned_by_the_model(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless(), start=0.5)
    servo, time = servo_of(segment), Time(segment)
    segment.inject(power_cycle(0, for_=0.3))
    time.pass_by(0.2)
    assert servo.position_rad < 0.45
    time.pass_by(0.2)
    assert segment.plant is not None
    assert servo.position_rad == segment.plant.data.joint("swing").qpos[0]


def test_replacement_drive_gets_the_motor(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless(), start=0.5)
    time = Time(segment)
    old, new = servo_of(segment), frictionless(name="spare")
    segment.inject(swap(0, Coupler(), for_=0.1))  # first a device without a motor
    segment.inject(swap(0, new, at=0.2, for_=0.1))
    time.pass_by(0.4)
    assert segment.plant is not None
    assert servo_of(segment) is new
    assert new.position_rad == segment.plant.data.joint("swing").qpos[0] != 0.5
    assert old.position == -1


def test_exchanged_drives_keep_their_motors(tmp_path: Path) -> None:
    joints = [Joint("shoulder", brake=100), Joint("elbow", brake=0, start=0.5)]
    servos = [frictionless(name="one"), frictionless(name="other")]
    segment = Segment(servos, plant=Plant(model(tmp_path, DOUBLE), joints))
    time = Time(segment)
    segment.inject(exchange(0, 1, for_=0.1))
    time.pass_by(0.3)
    assert segment.plant is not None
    assert [device.name for device in segment] == ["other", "one"]
    positions = [servo.position_rad for servo in servos]
    assert positions == segment.plant.data.qpos.tolist()
    assert positions[1] != 0.5


FINGER = """
<mujoco><option gravity="0 0 0"/><worldbody>
  <geom name="object" type="box" size=".02 .05 .05" pos=".1 0 0"/>
  <body name="finger"><joint name="grip" type="slide" axis="1 0 0"/>
    <geom type="box" size=".01 .02 .02" mass=".1"/></body>
</worldbody></mujoco>
"""


@pytest.mark.parametrize(("contacts", "grips"), [(True, True), (False, False)])
def test_finger_stops_at_an_object(tmp_path: Path, contacts: bool, grips: bool) -> None:
    """A spindle of 500 rad/m closes 70 mm until the faces meet."""
    plant = Plant(model(tmp_path, FINGER), [Joint("grip", gear=500.0, brake=0)], contacts=contacts)
    servo = Servo(inertia=1e-5, coulomb_friction=0.0)
    segment = Segment([servo], plant=plant)
    servo.apply_load(0.02)  # 10 N
    Time(segment).pass_by(2.0)
    assert (servo.position_rad / 500 == pytest.approx(0.07, abs=1e-3)) is grips
    assert grips or servo.position_rad / 500 > 0.075


def test_external_force_moves_the_arm(tmp_path: Path) -> None:
    """Force at the point mass of a hanging pendulum at rest: angle = force t² / 2 m l."""
    segment = pendulum(tmp_path, frictionless())
    assert segment.plant is not None
    segment.plant.data.body("rod").xfrc_applied[0] = 5.0  # N, at its centre of mass
    Time(segment).pass_by(0.05)
    angle = servo_of(segment).position_rad
    assert angle == pytest.approx(-0.5 * 5.0 / (MASS * LENGTH) * 0.05**2, rel=0.01)


def test_shaft_moved_by_hand_moves_the_joint(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless(), gear=10.0, brake=None)
    servo, time = servo_of(segment), Time(segment)
    servo.move_to(5.0)
    assert servo.position_rad == 5.0
    time.pass_by(0.01)
    assert segment.plant is not None
    assert segment.plant.data.joint("swing").qpos[0] == pytest.approx(0.5)


def test_two_runs_are_identical(tmp_path: Path) -> None:
    def run() -> bytes:
        joints = [Joint("shoulder", brake=0), Joint("elbow", gear=7, brake=0.01)]
        servos = [Servo(), Servo(inertia=1e-4)]
        segment = Segment(servos, plant=Plant(model(tmp_path, DOUBLE), joints))
        segment.inject(safe_torque_off(0, at=0.5))
        Time(segment).pass_by(3.0)
        assert segment.plant is not None
        return segment.plant.data.qpos.tobytes() + segment.plant.data.qvel.tobytes()

    assert run() == run()
