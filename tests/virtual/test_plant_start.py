"""Initial state of a plant with a free base: keyframes, contacts with the ground, a held body."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import Joint, Plant, Segment, Servo, read_segment
from tests.virtual.bodies import BOX, ON_THE_FLOOR
from tests.virtual.plants import GRAVITY, Time, model
from tests.virtual.test_plant_time import until

TURNED = [0, 0, 0.3, 0.5**0.5, 0, 0, 0.5**0.5, 0.5]


def test_free_base_needs_no_motor(tmp_path: Path) -> None:
    plant = Plant(model(tmp_path, ON_THE_FLOOR))
    assert [joint.name for joint in plant.joints] == ["hinge"]
    Time(Segment([Servo()], plant=plant)).pass_by(0.5)
    assert plant.data.qpos[2] == pytest.approx(0.1, abs=1e-3)  # it rests on the floor


def test_keyframe_is_the_initial_state(tmp_path: Path) -> None:
    plant = Plant(model(tmp_path, ON_THE_FLOOR), keyframe="turned")
    servo = Servo()
    Segment([servo], plant=plant)
    assert plant.data.qpos.tolist() == pytest.approx(TURNED)
    assert servo.position_rad == 0.5
    assert plant.data.time == 0.0


def test_start_of_a_joint_has_priority(tmp_path: Path) -> None:
    plant = Plant(model(tmp_path, ON_THE_FLOOR), [Joint("hinge", start=0.2)], keyframe="turned")
    assert plant.data.qpos.tolist() == pytest.approx([*TURNED[:7], 0.2])


def test_unknown_keyframe(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no keyframe 'sit'; its keyframes are turned"):
        Plant(model(tmp_path, ON_THE_FLOOR), keyframe="sit")


def test_compressed_contact_with_the_ground_is_accepted(tmp_path: Path) -> None:
    Plant(model(tmp_path, BOX.format(height=0.0985)))


def test_deep_contact_with_the_ground_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"'trunk' overlap by 5\.0 mm at the start"):
        Plant(model(tmp_path, BOX.format(height=0.095)))


# -- a held body ----------------------------------------------------------------------------------


def held(folder: Path, **options: object) -> Segment:
    plant = Plant(model(folder, ON_THE_FLOOR), keyframe="turned", held="trunk")
    return Segment([Servo()], plant=plant, **options)  # type: ignore[arg-type]


def test_held_body_stays_in_its_initial_pose(tmp_path: Path) -> None:
    segment = held(tmp_path)
    Time(segment).pass_by(0.5)
    assert segment.plant is not None
    assert segment.plant.data.qpos[:7].tolist() == pytest.approx(TURNED[:7], abs=1e-4)


def test_released_body_falls(tmp_path: Path) -> None:
    segment = held(tmp_path)
    time = Time(segment)
    time.pass_by(0.1)
    assert segment.plant is not None
    segment.plant.release()
    time.pass_by(0.1)
    fallen = 0.3 - segment.plant.data.qpos[2]
    assert fallen == pytest.approx(GRAVITY * 0.1**2 / 2, rel=0.02)
    segment.plant.release()  # again: no effect
    time.pass_by(0.01)
    assert 0.3 - segment.plant.data.qpos[2] > fallen


def test_release_in_real_time(tmp_path: Path) -> None:
    segment = held(tmp_path, clock="monotonic")
    plant = segment.plant
    assert plant is not None
    link = segment.open_link()
    until(lambda: plant.steps > 40)
    plant.release()
    before = plant.steps
    until(lambda: plant.steps > before + 400)
    link.close()
    assert plant.data.qpos[2] < 0.29


def test_release_without_a_held_body(tmp_path: Path) -> None:
    plant = Plant(model(tmp_path, ON_THE_FLOOR))
    with pytest.raises(ValueError, match="no body is held"):
        plant.release()


def test_unknown_body_cannot_be_held(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"no body 'pelvis'.*bodies are trunk, lid"):
        Plant(model(tmp_path, ON_THE_FLOOR), held="pelvis")


def test_segment_file(tmp_path: Path) -> None:
    model(tmp_path, ON_THE_FLOOR, "box.xml")
    file = tmp_path / "box.toml"
    file.write_text(
        '[[device]]\nkind = "servo"\n[plant]\nmodel = "box.xml"\nkeyframe = "turned"\n'
        'held = "trunk"\n'
    )
    segment = read_segment(file)
    Time(segment).pass_by(0.1)
    assert segment.plant is not None
    assert segment.plant.data.qpos[2] == pytest.approx(0.3, abs=1e-4)
