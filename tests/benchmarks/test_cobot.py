"""How the reaction to a stop's cause is counted: by the frames that were sent."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mcap", reason="recordings are MCAP files: pip install 'catenary[log]'")

from benchmarks import cobot
from benchmarks.cobot import reactions
from benchmarks.task_times import TaskTimes
from catenary.realtime.child import start_python

GO, BRAKE = 0x000F, 0x0002
ENABLED, QUICK_STOP_ACTIVE, SWITCHED_ON = 0x0237, 0x0217, 0x0233
MS = 1_000_000


class Cycles:
    """A recording of two axes, a cycle a millisecond, its frames 0.1 ms after the instant."""

    def __init__(self, words: list[int], states: list[int], cause: float) -> None:
        count = len(words)
        self.rows = np.zeros(
            count,
            [
                ("scheduled_ns", "i8"),
                ("lateness_ns", "i8"),
                ("receive_ns", "i8"),
                ("process_ns", "i8"),
                ("controlword", "u2", 2),
                ("statusword", "u2", 2),
            ],
        )
        self.rows["scheduled_ns"] = np.arange(count) * MS
        self.rows["process_ns"] = 100_000
        self.rows["controlword"] = np.array(words)[:, None]
        self.rows["statusword"] = np.array(states)[:, None]
        self.events = [
            SimpleNamespace(kind="DeviceLost", message="stop: no", time=0.0),
            SimpleNamespace(kind="Marker", message="stop: key", time=cause),
        ]

    def __getitem__(self, field: str) -> Any:
        return self.rows[field]


def test_the_frame_of_the_cycle_that_ran() -> None:
    cycles = Cycles([GO, BRAKE, BRAKE], [ENABLED, ENABLED, QUICK_STOP_ACTIVE], cause=1.05e-3)
    [answer] = reactions(cycles)  # type: ignore[arg-type]
    assert (answer.reason, answer.cycles) == ("key", 0)
    assert answer.seconds == pytest.approx(0.05e-3)


@pytest.mark.parametrize(("late", "cycles"), [(0, 1), (1, 2), (5, 6)])
def test_frames_of_later_cycles(late: int, cycles: int) -> None:
    words = [GO, GO, *[GO] * late, BRAKE, BRAKE]
    recorded = Cycles(words, [ENABLED] * len(words), cause=1.5e-3)
    [answer] = reactions(recorded)  # type: ignore[arg-type]
    assert answer.cycles == cycles
    assert answer.seconds == pytest.approx((0.6 + late) * 1e-3)


def test_one_axis_that_goes_on_is_no_stop() -> None:
    recorded = Cycles([GO, BRAKE, BRAKE], [ENABLED] * 3, cause=0.5e-3)
    recorded.rows["controlword"][1, 0] = GO
    [answer] = reactions(recorded)  # type: ignore[arg-type]
    assert answer.cycles == 2


def test_what_is_not_enabled_needs_no_quick_stop() -> None:
    [answer] = reactions(Cycles([GO, GO], [SWITCHED_ON] * 2, cause=0.5e-3))  # type: ignore[arg-type]
    assert answer.cycles == 0


def test_a_stop_that_never_came() -> None:
    with pytest.raises(ValueError, match="no quick stop was sent"):
        reactions(Cycles([GO] * 4, [ENABLED] * 4, cause=1.5e-3))  # type: ignore[arg-type]


def test_responses_longer_than_their_bound_are_named() -> None:
    row = (1.0, 1.0, 1.0, 0.0)
    times = {name: TaskTimes(row, row, (1.0, 200.0, 20.0, 0.0)) for name in ("a", "b", "c")}
    assert cobot.beyond(times, {"a": 201e-6, "b": 199e-6, "c": None}) == ["b", "c"]


def test_the_longest_time_between_two_looks_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([1.0, 1.5, 1.75])
    measured = cobot.Measured(virtual=False)
    monkeypatch.setattr(cobot.time, "clock_gettime", lambda _clock: next(times))
    for _ in range(3):
        measured.look(0.0)
    assert measured.executions == {cobot.MAIN: 0.5}


def test_in_virtual_time_no_processor_time_is_looked_at() -> None:
    measured = cobot.Measured(virtual=True)
    measured.look(1.0)
    assert measured.executions == {}
    assert measured.speed > 0


def test_a_child_is_found_by_the_module_it_runs() -> None:
    with start_python(["-m", "tests.benchmarks.waits"]) as child:
        assert child.read_line(30.0) == "here"
        assert cobot.child_that_runs("tests.benchmarks.waits") == child.pid
    assert cobot.child_that_runs("tests.benchmarks.waits") is None
