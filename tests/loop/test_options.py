"""Impossible options of a loop are refused before a frame is sent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest

import catenary as cat


@pytest.fixture
def main() -> Iterator[cat.MainDevice]:
    with cat.MainDevice("virtual") as main:
        main.scan()
        yield main


@pytest.fixture
def arm(main: cat.MainDevice) -> cat.Drives:
    return cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: cat.StopPolicy(lost_limit=0), "lost_limit=0: must be a whole number, at least 1"),
        (lambda: cat.StopPolicy(lost_limit=2.5), "lost_limit=2.5"),  # type: ignore[arg-type]
        (lambda: cat.StopPolicy(lost_limit=math.inf), "lost_limit=inf"),  # type: ignore[arg-type]
        (lambda: cat.StopPolicy(handover=-1.0), "handover=-1.0 s: must be positive and finite"),
        (lambda: cat.StopPolicy(stop_deadline=math.inf), "stop_deadline=inf s"),
        (lambda: cat.StopPolicy(stop_deadline=-2.0), "stop_deadline=-2.0 s"),
        (lambda: cat.Scheduling(quorum=0), "quorum=0"),
        (lambda: cat.ClockOptions(margin=-1.0), "margin=-1.0 s"),
        (lambda: cat.ClockOptions(burst=-1), "burst=-1"),
    ],
)
def test_an_impossible_option_is_named(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_reference_clock_is_a_device() -> None:
    with pytest.raises(TypeError, match="reference='coupler': must be a SubDevice"):
        cat.ClockOptions(reference="coupler")  # type: ignore[arg-type]


def test_a_group_of_options_has_its_class(arm: cat.Drives) -> None:
    with pytest.raises(TypeError, match=r"stop=None: must be a cat.StopPolicy\(\.\.\.\)"):
        cat.Loop(arm, stop=None)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"clocks='main': must be a cat"):
        cat.Loop(arm, clocks="main")  # type: ignore[arg-type]


def test_a_loop_takes_requests(main: cat.MainDevice) -> None:
    for wrong in (main, main.subs, main.subs[1], cat.Drives):
        with pytest.raises(TypeError, match="a Loop accepts process-data requests"):
            cat.Loop(wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="a Loop needs a process-data request"):
        cat.Loop()


def test_a_request_takes_devices(main: cat.MainDevice) -> None:
    servo = main.subs.drives[0]
    with pytest.raises(TypeError, match="Drives takes a list of SubDevices"):
        cat.Drives(servo, counts_per_turn=2**20)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"an axis is a SubDevice or .* not 2"):
        cat.Drives([2], counts_per_turn=2**20)  # type: ignore[list-item]
    with pytest.raises(TypeError, match="Outputs takes SubDevices, such as"):
        cat.Outputs([main.subs[1]])  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="ProcessData takes SubDevices, such as"):
        cat.ProcessData(main.subs)  # type: ignore[arg-type]


def test_a_phase_that_did_not_occur_is_named(arm: cat.Drives) -> None:
    with cat.Loop(arm) as loop:
        next(loop)
        with pytest.raises(KeyError, match="no phase 'latency' in these cycles; they have: period"):
            loop.timing["latency"]
