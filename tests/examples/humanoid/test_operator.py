"""Operator of the humanoid: modes, presets, refusals, the pose of the base, and a stop."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("numba", reason="laws need Numba: pip install 'catenary[law]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")
pytest.importorskip("mcap", reason="recordings are MCAP files: pip install 'catenary[log]'")

import catenary as cat
from catenary.errors import RequestRefused, ResponseTimeout
from tests.share.names import own_name
from tests.share.processes import Program

PROGRAM = Path(__file__).with_name("operated.py")
DEADLINE = 240.0  # [s]


@pytest.fixture
def name(tmp_path: Path) -> Iterator[str]:
    with own_name("humanoid") as name:
        program = Program.of([sys.executable, str(PROGRAM), name, str(tmp_path)])
        try:
            while "mode balance" not in (line := program.line()):
                assert line, "the program has ended"
            yield name
            program.process.wait(DEADLINE)
        finally:
            program.kill()
            program.close()


def until(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def ask(request: Callable[[str], object], name: str) -> None:
    """Repeat a request while the machine is too busy to answer it within its time."""
    for _ in range(20):
        with suppress(ResponseTimeout):
            request(name)
            return
    raise AssertionError(f"{name} was not answered")


def test_an_operator_selects_modes_and_presets(name: str) -> None:
    with (
        cat.attach(f"{name}-upper") as upper,
        cat.attach(f"{name}-lower") as lower,
        cat.attach(f"{name}-base") as base,
        cat.connect(f"{name}-upper") as robot,
    ):
        assert len(upper.layout.axes) == 18
        assert len(lower.layout.axes) == 15
        assert until(lambda: upper.mode == "balance")
        pelvis = base.read()["position"]
        assert pelvis[2] == pytest.approx(0.93, abs=0.02)
        elbow = upper.layout.axes.index("right_elbow")
        before = upper.read()["position"][elbow]
        ask(robot.run_preset, "wave")
        assert until(lambda: bool(abs(upper.read()["position"][elbow] - before) > 0.3))
        assert abs(upper.read()["position"]).max() < 2.6
        ask(robot.set_mode, "damping")
        assert until(lambda: upper.mode == "damping")
        with pytest.raises(RequestRefused, match="select stand first"):
            robot.run_preset("wave")
        assert until(lambda: bool(abs(base.read()["quaternion"][0]) < 0.9))  # it has sunk
        ask(robot.set_mode, "stand")
        assert until(lambda: not upper.alive)  # the safety task finds that it has fallen
        assert upper.state == "ended"
