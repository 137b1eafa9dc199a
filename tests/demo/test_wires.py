"""Segments of one plant on interface pairs, in the process of the program."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import catenary as cat
from catenary.demo.wires import _at_priority, on_wires
from catenary.errors import LinkError
from catenary.link import Interface
from catenary.realtime.private_network import Private, state
from catenary.virtual import Joint, Plant, Segment, Servo, faults
from tests.virtual.plants import DOUBLE, model

COUNTS = 1 << 20


def rings(folder: Path) -> tuple[Plant, list[Segment]]:
    joints = [Joint(name, gear=50, brake=0.0) for name in ("shoulder", "elbow")]
    plant = Plant(model(folder, DOUBLE), joints)
    return plant, [
        Segment(
            [Servo(name=joint.name)], plant=plant.part([joint.name]), clock="monotonic", ring=True
        )
        for joint in joints
    ]


@pytest.fixture(params=["frames", "links"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Run with real frames, and without a private network."""
    if request.param == "links":
        monkeypatch.setenv("CATENARY_PRIVATE_NETWORK", "refused for the test")
    elif not isinstance(state(), Private):
        pytest.skip("not in a private network namespace (`make test` starts it in one)")
    return str(request.param)


def test_loop_drives_the_plant_on_two_rings(tmp_path: Path, kind: str) -> None:
    """The joints turn, also after a cable of each ring was cut."""
    plant, segments = rings(tmp_path)
    with on_wires(segments) as targets:
        assert [len(each) for each in targets] == [2, 2]
        assert isinstance(targets[0][0], Interface) is (kind == "frames")
        with cat.MainDevice(*targets[0]) as one, cat.MainDevice(*targets[1]) as two:
            drives = [
                cat.Drives(main.scan().drives, gear_ratio=50, counts_per_turn=COUNTS,
                           velocity_limit=5.0)
                for main in (one, two)
            ]  # fmt: skip
            patient = cat.StopPolicy(lost_limit=1000, late_limit=0)  # the machine may be busy
            with cat.Loop(*drives, period=5e-3, stop=patient) as loop:
                for each in drives:
                    each.enable()
                turn(loop, drives, 0.05)
                for segment in segments:
                    segment.inject(faults.Cut(between=("main", 0)))
                turn(loop, drives, 0.1)
    assert plant.steps > 100
    assert [str(joint.name) for joint in plant.joints] == ["shoulder", "elbow"]


def turn(loop: cat.Loop, drives: list[cat.Drives], goal: float) -> None:
    """Move both joints to a position [rad] in small steps, and wait until they are there."""
    starts = [float(each.actual.position[0]) for each in drives]
    for step, _ in zip(range(4000), loop, strict=False):
        share = min(1.0, step / 100)
        for each, start in zip(drives, starts, strict=True):
            each.target.position[:] = start + share * (goal - start)
        angles = [float(each.actual.position[0]) for each in drives]
        if share == 1.0 and angles == pytest.approx([goal, goal], abs=0.01):
            return
    raise AssertionError(f"the joints stayed at {angles} rad, not {goal}")


def test_refused_priority_is_not_the_cause_of_a_later_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(_thread: int, policy: int, _: object) -> None:
        if policy == os.SCHED_FIFO:
            raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(LinkError) as raised, _at_priority(80):
        raise LinkError("down")
    assert raised.value.__context__ is None
