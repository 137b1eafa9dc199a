"""Plant in real time: a separate thread steps it, and frames never wait for it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import Joint, Plant, Segment, Server, Servo
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import MainDevice
from tests.virtual.plants import PENDULUM, Time, frictionless, model
from tests.virtual.test_server import BRD, answer, wire

PATIENCE = 20.0  # s


def swinging(folder: Path) -> Segment:
    plant = Plant(model(folder, PENDULUM), [Joint("swing", brake=0, start=0.5)])
    return Segment([frictionless()], plant=plant, clock="monotonic")


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(1e-3)


def steps(segment: Segment) -> int:
    assert segment.plant is not None
    return segment.plant.steps


def test_plant_moves_without_frames(tmp_path: Path) -> None:
    segment = swinging(tmp_path)
    servo = segment[0]
    assert isinstance(servo, Servo)
    link = segment.open_link()
    until(lambda: servo.position_rad < 0.4)
    until(lambda: steps(segment) > 400)
    link.close()
    after = steps(segment)
    assert segment.plant is not None
    assert segment.plant.data.time == pytest.approx(after * 250e-6)
    link = segment.open_link()  # it continues from its last position
    until(lambda: steps(segment) > after + 40)
    link.close()


def test_frame_is_answered_without_a_step(tmp_path: Path) -> None:
    """While the plant thread is stopped, no other thread steps the plant, and frames return."""
    segment = swinging(tmp_path)
    main = MainDevice(segment)
    until(lambda: steps(segment) > 10)
    assert segment.plant is not None
    segment.plant.stop()
    before = steps(segment)
    for _ in range(50):
        answer = main.exchange(EcatCommand.BRD, 0, 0x0130, bytes(2))
        assert answer.working_counter == 1
    assert steps(segment) == before
    segment.plant.start()
    until(lambda: steps(segment) > before)
    main.link.close()


def test_served_arm_moves(tmp_path: Path, veth: tuple[str, str]) -> None:
    segment = swinging(tmp_path)
    with Server(segment, veth[1], max_age=None), wire(veth[0]) as near:
        for _ in range(20):
            near.send(BRD)
            assert answer(near) == 1
        until(lambda: steps(segment) > 400)
    ended = steps(segment)
    assert ended > 400


def free(folder: Path, text: str = PENDULUM, **options: object) -> tuple[Segment, Servo]:
    plant = Plant(model(folder, text), [Joint("swing", brake=0)])
    servo = frictionless()
    return Segment([servo], plant=plant, **options), servo  # type: ignore[arg-type]


def test_diverged_simulation_stops_with_an_error(tmp_path: Path) -> None:
    segment, servo = free(tmp_path)
    time = Time(segment)
    servo.apply_load(3e9)
    with pytest.raises(
        ConfigurationError, match=r"after 0\.000. s: joint 'swing' exceeded 1e6 rad/s"
    ):
        time.pass_by(0.01)


def test_nan_is_reported_with_the_message_of_mujoco(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MuJoCo itself would write it to a file."""
    monkeypatch.chdir(tmp_path)
    segment, servo = free(tmp_path)
    time = Time(segment)
    servo.apply_load(math.nan)
    with pytest.raises(ConfigurationError, match="MuJoCo reports: Nan, Inf or huge value in QACC"):
        time.pass_by(0.01)
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


BOXES = "".join(
    f"""<body pos="{0.3 * (k % 4)} {0.3 * (k // 4)} .5"><freejoint/>
    <geom type="box" size=".1 .1 .1" mass="1"/></body>"""
    for k in range(12)
)
CROWDED = """<mujoco><size memory="{}K"/><worldbody><geom type="plane" size="3 3 .1"/>{}
  <body pos="0 0 3"><joint name="swing"/><geom size=".05" pos="0 .1 0"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("kilobytes", [20, 40, 70])
def test_too_little_memory_for_contacts_does_not_end_the_process(
    tmp_path: Path, kilobytes: int
) -> None:
    """Boxes fall on the floor. Without an error handler, MuJoCo would end the process."""
    segment, _servo = free(tmp_path, CROWDED.format(kilobytes, BOXES))
    with pytest.raises(ConfigurationError, match=r"MuJoCo reports: .*memory"):
        Time(segment).pass_by(1.0)


def test_frames_are_answered_after_the_simulation_has_stopped(
    tmp_path: Path, veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[object] = []
    monkeypatch.setattr(threading, "excepthook", lambda what: said.append(what.exc_value))
    segment, servo = free(tmp_path, clock="monotonic")
    with Server(segment, veth[1], max_age=None) as server, wire(veth[0]) as near:
        servo.apply_load(3e9)
        until(lambda: bool(said))
        near.send(BRD)
        assert answer(near) == 1
        with pytest.raises(ConfigurationError, match="exceeded 1e6 rad/s"):
            server.raise_failure()
    assert isinstance(said[0], ConfigurationError)
