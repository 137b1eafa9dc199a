"""The soak finds no violation in a correct program, repeats itself, and finds planted errors."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import cast, get_args

import pytest

import catenary as cat
from benchmarks.cli.main import main
from benchmarks.soak import minute as minutes
from benchmarks.soak.cell import GRIPPER, TOOL, Part, make_segment
from benchmarks.soak.commands import DISABLE_OPERATION, ENABLE, QUICK_STOP, Commands
from benchmarks.soak.effects import disturbed, fits, may_end, out_of_reach
from benchmarks.soak.faults import PYTHON_LATE, Incident, draw, told
from benchmarks.soak.minute import Minute
from benchmarks.soak.run import as_text, soak, soaked_minute
from benchmarks.soak.setting import Mode, Setting, setting_of, settings
from benchmarks.soak.witness import Witness
from catenary.loop.fault_report import FaultReport
from catenary.loop.watches.device import Watch
from catenary.virtual import DigitalOutputs, Fault, Segment, Servo
from catenary.virtual import faults as f
from catenary.virtual.devices.motor_device import Received

SEED = 7
LINE, RING, CLOCKS = Setting(), Setting("ring"), Setting("line", True)


def soaked(
    monkeypatch: pytest.MonkeyPatch,
    *faults: Fault,
    seconds: float = 1.5,
    setting: Setting = LINE,
) -> Minute:
    """Return a minute in which one known incident happens to a running loop."""
    due = [Incident(faults)]
    monkeypatch.setattr(minutes, "draw", lambda *_: due.pop() if due else Incident(()))
    monkeypatch.setattr(minutes, "AT_START", 0.0)
    minute = Minute(SEED, seconds, setting)
    minute.run()
    return minute


def invariants(minute: Minute) -> set[str]:
    return {violation.invariant for violation in minute.violations}


@pytest.mark.parametrize("setting", settings(), ids=str)
def test_some_seconds_without_a_violation(setting: Setting) -> None:
    found = soak(8.0, SEED, [setting])
    assert not found.violations, as_text(found)
    assert found.figures.cycles > 1000
    assert found.figures.incidents > 1


def test_the_minutes_take_all_settings_in_turn() -> None:
    taken = [setting_of(seed, settings()) for seed in range(12)]
    assert set(taken) == set(settings())
    assert [setting.wiring for setting in taken[:4]] == ["line", "ring"] * 2
    assert [setting.clocks for setting in taken[:4]] == [False, False, True, True]


def test_the_same_seed_is_the_same_run() -> None:
    first, second, other = soak(3.0, SEED), soak(3.0, SEED), soak(3.0, SEED + 1)
    assert first.figures == second.figures
    assert first.digests == second.digests != other.digests


@pytest.mark.parametrize("setting", [LINE, RING, CLOCKS], ids=str)
def test_all_kinds_of_faults_are_drawn_and_fit(setting: Setting) -> None:
    random, segment, kinds = Random(1), make_segment(setting, Random(1)), set()
    for _ in range(1000):
        incident = draw(random, 1.0, setting)
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
    assert "no device left in OP" in invariants(minute)


def test_a_device_that_is_not_brought_back_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        Watch, "_start_return", lambda self, charge, conversation: conversation.close()
    )
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
    select = ["--wiring", "line", "--no-clocks", "--mode", "csv"]
    file = str(tmp_path / "soak.json")
    arguments = ["soak", "--minutes", "0.02", *select, "--json", file]
    assert main(arguments) == 0
    assert "0 violations" in capsys.readouterr().out
    figures = json.loads((tmp_path / "soak.json").read_text())
    assert figures["cycles"] > 100
    assert figures["violations"] == []
    monkeypatch.setattr(cat.MainDevice, "leave", lambda self: None)
    assert main(arguments) == 1
    printed = capsys.readouterr().out
    assert "minute 1, seed 1 (line, no clocks, CSV), at" in printed
    assert "no device left in OP" in printed
    again = "python -m benchmarks soak --minutes 0.02 --seed 1 --wiring line --no-clocks --mode csv"
    assert again in printed


def test_the_same_loss_declared_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    minute = soaked(monkeypatch, f.LoseFrames(n=1, at=0.3, for_=0.1))
    assert not minute.violations
    assert minute.figures.losses == {"injected": 1}
    assert minute.figures.not_ok == 1


# Rings


def test_a_cut_isolates_the_rest_of_a_line_and_nothing_of_a_ring() -> None:
    faults = [f.Cut(between=(2, 3))]
    assert out_of_reach(faults, ring=False) == {3, 4, 5, 6}
    assert out_of_reach(faults, ring=True) == set()
    assert may_end(faults, ring=False)
    assert not may_end(faults, ring=True)


@pytest.mark.parametrize(
    ("faults", "isolated"),
    [
        ([f.Cut(between=(3, 4)), f.Cut(between=(5, 6))], {4, 5}),
        ([f.Cut(between=("main", 0)), f.Unplug(device=2)], {0, 1}),
        ([f.PowerCycle(device=4)], {4}),
        ([f.PowerCycle(device=4), f.Cut(between=(6, "main"))], {4, 5, 6}),
        ([f.Exchange(device=2, other=4)], {2, 3, 4}),
        ([f.Cut(between=(6, "main"))], set()),
        ([f.Corrupt(between=(4, 5), every=1, for_=1.0)], {5, 6}),
        ([f.Corrupt(between=(4, 5), every=1, for_=1.0), f.Cut(between=(5, 6))], {5}),
        ([f.Corrupt(between=(4, 5), every=1, for_=1.0), f.Cut(between=(2, 3))], {3, 4, 5, 6}),
    ],
)
def test_what_is_out_of_reach_in_a_ring(faults: list[Fault], isolated: set[int]) -> None:
    assert out_of_reach(faults, ring=True) == isolated


def test_every_second_frame_of_a_ring_may_be_the_same_copy() -> None:
    faults = [f.LoseFrames(every=2, for_=1.0)]
    assert disturbed(faults, ring=True) == set(range(7))
    assert disturbed(faults, ring=False) == set()


def test_two_cuts_may_only_isolate_what_is_not_required() -> None:
    assert fits([f.Cut(between=(5, 6))], [f.Cut(between=(3, 4))], ring=True)
    assert not fits([f.Cut(between=(1, 2))], [f.Cut(between=(3, 4))], ring=True)
    assert fits([f.Cut(between=(1, 2))], [f.Cut(between=(3, 4))], ring=False)
    assert not fits([f.Unplug(device=4)], [f.Cut(between=(3, 4))], ring=False)


def test_a_ring_that_is_cut_loses_no_cycle_but_those_under_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cut = f.Cut(between=(2, 3), at=0.3, for_=0.2)
    minute = soaked(monkeypatch, cut, setting=RING, seconds=1.0)
    assert not minute.violations
    assert minute.figures.ended == {"left unasked": 1}
    assert minute.figures.not_ok <= 2


def test_a_cycle_that_a_cut_ring_loses_later_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    cut = f.Cut(between=(2, 3), at=0.3, for_=0.2)
    judge = Witness.judge_cycle

    def lossy(self: Witness, ok: bool, present: dict[int, bool]) -> None:
        judge(self, ok and not 0.4 < self.segment.time < 0.405, present)

    monkeypatch.setattr(Witness, "judge_cycle", lossy)
    minute = soaked(monkeypatch, cut, setting=RING, seconds=1.0)
    assert invariants(minute) == {"no undeclared loss"}


# Axes and clocks


def test_a_stop_without_an_event_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FaultReport, "report_axes", lambda self, **_: [])
    minute = soaked(monkeypatch, f.SafeTorqueOff(device=TOOL, at=0.3, for_=0.1))
    assert "no silent stop" in invariants(minute)


def test_a_stop_without_a_reason_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cat.Drives, "stopped", property(lambda self: (None,) * len(self)))
    minute = soaked(monkeypatch, f.SafeTorqueOff(device=TOOL, at=0.3, for_=0.1))
    assert "no silent stop" in invariants(minute)


@pytest.mark.parametrize("mode", ["csp", "csv"])
def test_a_jump_of_the_command_is_found(monkeypatch: pytest.MonkeyPatch, mode: Mode) -> None:
    step = Part.step

    def jump(self: Part, time: float) -> None:
        step(self, time)
        values = self.drives.target.position if mode == "csp" else self.drives.target.velocity
        values[:] += 0.001 if mode == "csp" and 0.6 < time < 0.61 else 0.0
        values[:] += 0.5 if mode == "csv" and 0.6 < time < 0.61 else 0.0

    monkeypatch.setattr(Part, "step", jump)
    minute = soaked(monkeypatch, setting=Setting(mode=mode))
    assert "commands within limits" in invariants(minute)


@pytest.mark.parametrize("word", [QUICK_STOP, DISABLE_OPERATION])
@pytest.mark.parametrize(("torque", "found"), [(0, ["a stop keeps the torque"]), (150, [])])
def test_zero_torque_in_the_frame_that_stops_is_found(
    word: int, torque: int, found: list[str]
) -> None:
    received = Received(ENABLE, 0, 0, 150)
    servo = SimpleNamespace(outputs_taken_ns=0, rated_torque=2.0, received=lambda: received)
    commands = Commands("cst")
    broken = commands.look(cast("Servo", servo), "OPERATION ENABLED")
    servo.outputs_taken_ns += 1_000_000
    received = Received(word, 0, 0, torque)
    broken += commands.look(cast("Servo", servo), "QUICK STOP ACTIVE")
    assert [invariant for invariant, _ in broken] == found


def test_a_clock_that_does_not_come_back_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Witness, "worst_clock", lambda self: (TOOL, 1e-3))
    monkeypatch.setattr(minutes, "CLOCK_RECOVERY", 0.5)
    drift = f.Drift(device=TOOL, ppm=10.0, at=3.0, for_=0.1)
    minute = soaked(monkeypatch, drift, setting=CLOCKS, seconds=4.0)
    assert "all back" in invariants(minute)


def test_a_clock_that_leaves_without_a_fault_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    worst = Witness.worst_clock

    def worst_clock(self: Witness) -> tuple[int, float]:
        return (TOOL, 5e-6) if self.calm and self.segment.time > 3.5 else worst(self)

    monkeypatch.setattr(Witness, "worst_clock", worst_clock)
    minute = soaked(monkeypatch, setting=CLOCKS, seconds=5.0)
    assert "clocks within bound" in invariants(minute)


def test_a_fault_excuses_a_scan_that_it_ends_at_once() -> None:
    """The error comes 0.25 ms after two devices changed places, before the witness looks again."""
    minute = soaked_minute(4, 36.0, Setting("line", False, "csv"))
    assert minute.figures.faults["exchange"]
    assert not minute.violations
