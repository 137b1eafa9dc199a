"""The soak finds nothing where all is well, the same twice, and finds what is planted."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import get_args

import pytest

import catenary as cat
from catenary.bench.soak import minute as minutes
from catenary.bench.soak.cell import GRIPPER, TOOL, make_segment
from catenary.bench.soak.faults import PYTHON_LATE, Incident, draw, told
from catenary.bench.soak.minute import Minute
from catenary.bench.soak.run import as_text, soak
from catenary.bench.soak.witness import Witness
from catenary.cli.main import main
from catenary.loop.watch import Watch
from catenary.virtual import DigitalOutputs, Fault, Segment, Servo
from catenary.virtual import faults as f

SEED = 7


def soaked(monkeypatch: pytest.MonkeyPatch, *faults: Fault, seconds: float = 1.5) -> Minute:
    """A minute in which one known incident happens to a running loop, and then it is left."""
    due = [Incident(faults)]
    monkeypatch.setattr(minutes, "draw", lambda random, now: due.pop() if due else Incident(()))
    monkeypatch.setattr(minutes, "AT_START", 0.0)
    minute = Minute(SEED, seconds)
    minute.run()
    return minute


def invariants(minute: Minute) -> set[str]:
    return {violation.invariant for violation in minute.violations}


def test_ten_seconds_without_a_violation() -> None:
    found = soak(10.0, SEED)
    assert not found.violations, as_text(found)
    assert found.figures.cycles > 1000
    assert found.figures.incidents > 10


def test_the_same_seed_is_the_same_run() -> None:
    first, second, other = soak(3.0, SEED), soak(3.0, SEED), soak(3.0, SEED + 1)
    assert first.figures == second.figures
    assert first.digests == second.digests != other.digests


def test_all_kinds_of_faults_are_drawn_and_fit() -> None:
    random, segment, kinds = Random(1), make_segment(), set()
    for _ in range(1000):
        incident = draw(random, 1.0)
        kinds |= set(incident.kinds)
        for fault in incident.faults:
            segment.inject(fault)
    assert kinds == {PYTHON_LATE} | {word.__struct_config__.tag for word in get_args(Fault)}


def test_a_fault_is_told_alike_in_every_run() -> None:
    fault = f.Swap(device=4, with_=Servo(serial=77), at=0.5)
    assert told(fault) == "swap(device=4, with_=77, at=0.5000)"


def test_a_loss_that_is_not_declared_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Segment, "take_losses", lambda self: [])
    minute = soaked(monkeypatch, f.LoseFrames(n=1, at=0.3, for_=0.1))
    assert "no undeclared loss" in invariants(minute)


def test_a_loss_that_nothing_explains_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Segment, "fault_log", property(lambda self: ()))
    minute = soaked(monkeypatch, f.LoseFrames(n=1, at=0.3, for_=0.1))
    assert "no undeclared loss" in invariants(minute)


def test_outputs_that_stay_on_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DigitalOutputs, "outputs", 0x0F)
    minute = soaked(monkeypatch, f.Unplug(device=GRIPPER, at=0.3, for_=0.3))
    assert "outputs safe" in invariants(minute)


def test_a_device_that_is_left_in_op_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cat.MainDevice, "leave", lambda self: None)
    minute = soaked(monkeypatch, f.Drift(device=TOOL, ppm=10.0, at=0.3, for_=0.1))
    assert "nobody left in OP" in invariants(minute)


def test_a_device_that_is_not_led_back_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Watch, "_lead", lambda self, charge, conversation: conversation.close())
    minute = soaked(monkeypatch, f.LeaveState(device=TOOL, at=0.3), seconds=6.0)
    assert "all back" in invariants(minute)


def test_an_axis_that_is_enabled_unasked_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Witness, "ask", lambda self, positions: None)
    minute = soaked(monkeypatch, seconds=0.5)
    assert "nothing moves unasked" in invariants(minute)


def test_a_mistake_of_ours_is_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Watch, "run", lambda self: 1 / 0)
    found = soak(1.0, SEED)
    assert "ZeroDivisionError" in as_text(found)


def test_the_command_tells_by_its_exit_status(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["bench", "soak", "--minutes", "0.02", "--json", str(tmp_path / "soak.json")]
    assert main(arguments) == 0
    assert "0 violations" in capsys.readouterr().out
    figures = json.loads((tmp_path / "soak.json").read_text())
    assert figures["cycles"] > 100
    assert figures["violations"] == []
    monkeypatch.setattr(cat.MainDevice, "leave", lambda self: None)
    assert main(arguments) == 1
    assert "nobody left in OP" in capsys.readouterr().out


def test_the_same_loss_declared_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    minute = soaked(monkeypatch, f.LoseFrames(n=1, at=0.3, for_=0.1))
    assert not minute.violations
    assert minute.figures.losses == {"injected": 1}
    assert minute.figures.not_ok == 1
