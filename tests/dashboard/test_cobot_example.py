"""examples/cobot/dashboard.py: the arm moves, yields to a push, and a cut ring heals."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.share import Reader
from tests.share.names import own_name
from tests.share.processes import Program

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "cobot" / "dashboard.py"
DEADLINE = 60.0  # [s]

pytest.importorskip("mujoco")


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("cobot") as name:
        program = Program.of([sys.executable, str(EXAMPLE), "--name", name, "--seconds", "90"])
        try:
            assert program.line().startswith("the arm moves")
            yield name
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


def messages(reader: Reader) -> str:
    return "\n".join(event.message for event in reader.events()[0])


def test_the_arm_moves_yields_and_survives_a_cut(name: str) -> None:
    with cat.attach(name) as arm, cat.connect(name) as program:
        assert arm.wait(10.0)
        start = arm.read()["position"].copy()
        assert until(lambda: bool(np.ptp([start, arm.read()["position"]], axis=0).max() > 0.5))
        before = arm.number
        program.virtual_push("link4", [0.0, 0.0, -200.0], seconds=1.0)
        assert until(lambda: arm.number > before + 500)
        torque = arm.rows(before)[0]["torque"][:, 1]
        assert np.ptp(torque) > 30.0  # [N·m], the shoulder carries the push
        program.virtual_cable(2, 1, False)
        assert until(lambda: "the ring is cut between 2 and 3" in messages(arm))
        program.virtual_cable(2, 1, True)
        assert until(lambda: "the cable between 2 and 3 carries frames again" in messages(arm))
        assert arm.read()["enabled"].all()
        arm.stop()
        assert until(lambda: not arm.read()["enabled"].any())
        assert until(lambda: "an operator requested a quick stop" in messages(arm))
        with arm.lease() as lease:
            lease.request("enable")
            assert until(lambda: bool(arm.read()["enabled"].all()))


def test_the_arm_survives_a_device_without_power(name: str) -> None:
    with cat.attach(name) as arm, cat.connect(name) as program:
        assert arm.wait(10.0)
        program.virtual_power(2, False)
        assert until(lambda: "device 2 (elbow) does not answer any more" in messages(arm))
        program.virtual_power(2, True)
        assert until(lambda: "device 2 (elbow) answers again" in messages(arm))
        assert until(lambda: program.devices()[2].state == "OP")
        with arm.lease() as lease:
            lease.request("enable")
            assert until(lambda: bool(arm.read()["enabled"].all()))
