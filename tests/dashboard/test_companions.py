"""Further shares of a page: their axes in the scene, the base, and the stop."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.dashboard.companions import Companions
from catenary.dashboard.options import Panels
from catenary.dashboard.scene_feed import SceneFeed, pose_of
from catenary.sensors import Channel, SensorShare
from catenary.share import Reader
from tests.dashboard.serving import Page, running_loop, serving
from tests.dashboard.test_scene import poses
from tests.share.names import own_name
from tests.share.processes import comes_true

MODEL = """<mujoco><worldbody><geom type="plane" size="9 9 1"/>
<body name="pelvis" pos="0 0 1"><freejoint name="base"/><geom size=".1"/>
<body name="left"><joint name="left" axis="0 0 1"/><geom size=".1"/></body>
<body name="right"><joint name="right" axis="0 0 1"/><geom size=".1"/></body>
</body></worldbody></mujoco>"""
POSE = [Channel("position", "m", (3,)), Channel("quaternion", "", (4,))]
PELVIS, LEFT, RIGHT = 1, 2, 3  # bodies


@pytest.fixture
def model(tmp_path: Path) -> Path:
    pytest.importorskip("mujoco")
    (tmp_path / "robot.xml").write_text(MODEL)
    return tmp_path / "robot.xml"


@pytest.fixture
def networks(name: str) -> Iterator[tuple[str, str]]:
    """Two loops, each with one axis."""
    upper, lower = f"{name}-upper", f"{name}-lower"
    with running_loop(upper, 1, "still", "left,"), running_loop(lower, 1, "still", "right,"):
        yield upper, lower


def readers_of(stack: ExitStack, *names: str) -> list[Reader]:
    return [stack.enter_context(cat.attach(name)) for name in names]


def publish(share: SensorShare, height: float) -> None:
    values = {"position": [1.0, 2.0, height], "quaternion": [0.0, 0.0, 0.0, 1.0]}
    share.publish(values, time.monotonic_ns())


def test_the_scene_has_the_axes_of_all_networks(model: Path, networks: tuple[str, str]) -> None:
    with ExitStack() as stack:
        readers = readers_of(stack, *networks)
        feed = SceneFeed(model, {}, moves=True, shares=2)
        scene = feed.scene(readers)
        assert scene is not None
        assert scene.joints == ("left", "right")
        actual, *_ = poses(feed.poses(readers))
        for reader, body in zip(readers, (LEFT, RIGHT), strict=True):
            angle = float(reader.read()["position"][0])
            assert actual[body, 6] == pytest.approx(np.sin(angle / 2), abs=1e-3)


def test_joints_of_an_absent_network_wait_for_it(model: Path, networks: tuple[str, str]) -> None:
    with ExitStack() as stack:
        readers = readers_of(stack, *networks)
        feed = SceneFeed(model, {"left": "right", "right": "left"}, shares=2)
        first = feed.scene(readers[:1])
        assert first is not None
        assert first.joints == ("right",)
        both = feed.scene(readers)
        assert both is not None
        assert both.joints == ("right", "left")


def test_axes_of_one_name_have_no_scene(model: Path, name: str) -> None:
    with running_loop(name, 1, "left,"), cat.attach(name) as reader:
        feed = SceneFeed(model, {})
        assert feed.scene([reader, reader]) is None
        assert "the same name: left" in feed.problem
        assert feed.poses([reader, reader]) == b""


def test_the_base_follows_its_share_and_keeps_the_last_pose(model: Path, name: str) -> None:
    base_name = f"{name}.base"
    with (
        running_loop(name, 2, "left,right"),
        cat.attach(name) as reader,
        SensorShare(base_name, POSE, rate=100.0) as share,
        cat.attach(base_name) as base,
    ):
        feed = SceneFeed(model, {}, moves=True)
        assert poses(feed.poses([reader], base))[0][PELVIS, :3] == pytest.approx([0, 0, 1])
        publish(share, 0.7)
        actual, ghost, *_ = poses(feed.poses([reader], base))
        assert actual[PELVIS] == pytest.approx([1, 2, 0.7, 0, 0, 0, 1])
        assert ghost[PELVIS] == pytest.approx(actual[PELVIS])
        share.invalidate("no contact with the ground")
        assert poses(feed.poses([reader], base))[0][PELVIS, 2] == pytest.approx(0.7)
        assert poses(feed.poses([reader], None))[0][PELVIS, 2] == pytest.approx(0.7)


def test_a_share_without_a_pose_moves_no_base(name: str) -> None:
    channels = [Channel("position", "m", (2,)), Channel("quaternion", "", (4,))]
    with SensorShare(name, channels, rate=100.0) as share, cat.attach(name) as reader:
        values = {"position": [0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}
        share.publish(values, time.monotonic_ns())
        assert pose_of(reader) is None


def test_a_model_without_a_free_joint_has_no_base(tmp_path: Path, name: str) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body><joint name="left"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    with running_loop(name, 1, "left,"), cat.attach(name) as reader:
        feed = SceneFeed(path, {}, moves=True)
        assert feed.scene([reader]) is None
        assert "no free joint" in feed.problem


def stopped(name: str) -> bool:
    with cat.attach(name) as reader:
        return comes_true(lambda: any("quick stop" in each.message for each in reader.events()[0]))


def attached(page: Page) -> bool:
    return comes_true(lambda: len(page.hub.readers) == 1 + len(page.hub.companions._also))


def test_the_stop_of_the_page_reaches_all_networks(networks: tuple[str, str]) -> None:
    upper, lower = networks
    with serving(upper, panels=Panels(also=(lower,))) as page, page.socket() as socket:
        assert attached(page)
        socket.send("stop")
        assert socket.next("stopped")
    assert stopped(upper)
    assert stopped(lower)


def test_a_stop_that_misses_a_network_is_an_error(name: str) -> None:
    with (
        running_loop(name, 1, "still"),
        serving(name, panels=Panels(also=(f"{name}-lower",))) as page,
        page.socket() as socket,
    ):
        assert socket.next("status")
        socket.send("stop")
        error = socket.next("error")
        assert error["about"] == "stop"
        assert f"the stop did not reach '{name}-lower'" in str(error["message"])
        assert stopped(name)


def test_a_missing_page_share_does_not_keep_the_stop_from_the_others(name: str) -> None:
    lower = f"{name}-lower"
    with (
        running_loop(lower, 1, "still"),
        serving(name, panels=Panels(also=(lower,))) as page,
        page.socket() as socket,
    ):
        assert comes_true(lambda: bool(page.hub.companions.networks))
        socket.send("stop")
        message = str(socket.next("error")["message"])
        assert f"the stop did not reach '{name}': " in message
        assert f"'{lower}': " not in message
        assert stopped(lower)


def test_companions_attach_and_detach() -> None:
    with own_name("also") as name:
        companions = Companions([name])
        companions.step()
        assert companions.networks == []
        (failure,) = companions.stop()
        assert failure.startswith(f"'{name}': ")
        with running_loop(name, 1):
            assert comes_true(lambda: companions.step() or bool(companions.networks))
        assert comes_true(lambda: companions.step() or not companions.networks)
        companions.close()


def test_the_page_serves_the_scene_of_all_networks(model: Path, networks: tuple[str, str]) -> None:
    upper, lower = networks
    with serving(upper, panels=Panels(model=model, also=(lower,))) as page:
        assert attached(page)
        with page.client() as client:
            answer = client.get("/scene")
            assert answer.status_code == 200
            assert b'"joints": ["left", "right"]' in answer.content
