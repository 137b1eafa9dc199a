"""An inline loop gets the interpreter in time."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.loop.interpreter import SWITCH_INTERVAL, prompt_interpreter
from catenary.virtual import Segment, Servo


@pytest.fixture(autouse=True)
def pythons_own() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(0.005)
    yield
    sys.setswitchinterval(before)


def interval() -> float:
    return round(sys.getswitchinterval(), 6)


def test_the_switch_interval_is_short_until_the_last_loop_has_gone() -> None:
    first, second = prompt_interpreter(), prompt_interpreter()
    first.__enter__()
    second.__enter__()
    assert interval() == SWITCH_INTERVAL
    first.__exit__(None, None, None)
    assert interval() == SWITCH_INTERVAL
    second.__exit__(None, None, None)
    assert interval() == 0.005


def test_a_shorter_one_stays() -> None:
    sys.setswitchinterval(5.5e-6)
    with prompt_interpreter():
        assert interval() == 5e-6
    assert interval() == 5e-6


@pytest.mark.parametrize(
    ("clock", "run", "during"),
    [
        ("monotonic", "inline", SWITCH_INTERVAL),
        ("monotonic", "threaded", 0.005),
        ("virtual", "inline", 0.005),
    ],
)
def test_a_loop_wants_it_while_it_is_inline_and_time_is_real(
    clock: str, run: str, during: float
) -> None:
    with cat.MainDevice(Segment([Servo()], clock=clock)) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=1 << 20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=5e-3, run=run, lost_limit=1000, late_limit=0) as loop:
            next(iter(loop))
            assert interval() == during
        assert interval() == 0.005
