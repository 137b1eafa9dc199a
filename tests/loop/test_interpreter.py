"""The interpreter's switch interval is an option of inline loops."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.loop.interpreter import switch_interval
from catenary.virtual import Segment, Servo


@pytest.fixture(autouse=True)
def pythons_own() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(0.005)
    yield
    sys.setswitchinterval(before)


def interval() -> float:
    return round(sys.getswitchinterval(), 6)


def test_the_shortest_interval_counts_until_the_last_loop_is_closed() -> None:
    first, second = switch_interval(100e-6), switch_interval(20e-6)
    first.__enter__()
    second.__enter__()
    assert interval() == 20e-6
    second.__exit__(None, None, None)
    assert interval() == 100e-6
    first.__exit__(None, None, None)
    assert interval() == 0.005


@pytest.mark.parametrize(
    ("clock", "run", "option", "during"),
    [
        ("monotonic", "inline", 20e-6, 20e-6),
        ("monotonic", "inline", None, 0.005),
        ("monotonic", "threaded", 20e-6, 0.005),
        ("virtual", "inline", 20e-6, 0.005),
    ],
)
def test_an_inline_loop_sets_it_in_real_time(
    clock: str, run: str, option: float | None, during: float
) -> None:
    with cat.MainDevice(Segment([Servo()], clock=clock)) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=1 << 20, velocity_limit=6.0
        )
        with cat.Loop(
            arm,
            period=5e-3,
            execution=run,
            stop=cat.StopPolicy(lost_limit=1000, late_limit=0),
            scheduling=cat.Scheduling(switch_interval=option),
        ) as loop:
            next(iter(loop))
            assert interval() == during
        assert interval() == 0.005


@pytest.mark.parametrize("option", [0.0, -1.0, 2.0, float("nan")])
def test_an_impossible_interval_is_refused(option: float) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=1 << 20, velocity_limit=6.0)
        with pytest.raises(ValueError, match="switch_interval"):
            cat.Loop(arm, scheduling=cat.Scheduling(switch_interval=option))
