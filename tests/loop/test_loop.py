"""Arguments that Loop refuses before it sends a frame."""

import contextlib
import math
from typing import Literal

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, DriveError, WorkingCounterError
from catenary.virtual import Segment, Servo
from tests.loop_options import grouped


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        ({"busy_wait": 1e-3}, "less than the period"),
        ({"busy_wait": -1e-6}, "positive time"),
        ({"collect_deadline": 1.5}, "share of the period"),
        ({"execution": "fast"}, "threaded"),
        ({"period": 0.0}, "period=0.0 s: must be 1e-06 to 1000 s"),
        ({"period": -1e-3}, "period=-0.001 s"),
        ({"period": math.nan}, "period=nan s"),
    ],
)
def test_impossible_arguments_are_refused(asked: dict, named: str) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with pytest.raises(ValueError, match=named):
            cat.Loop(arm, **grouped({"period": 1e-3, "execution": "inline", **asked}))


@pytest.mark.parametrize(
    ("run", "period", "error"),
    [
        ("threaded", 1e-6, ConfigurationError),
        ("threaded", 10e-6, ConfigurationError),  # too late for the collect deadline
        ("inline", 8e-6, ConfigurationError),
        ("inline", 10e-6, WorkingCounterError),  # too short for the delays of the device
    ],
)
def test_a_period_too_short_for_the_frames_names_their_time(
    run: Literal["threaded", "inline"], period: float, error: type[Exception]
) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with pytest.raises(error, match=r"the cyclic frames take 8\.4 us"):
            cat.Loop(arm, period=period, execution=run).__enter__()


def test_the_log_has_the_requested_length() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3, execution="inline", log=1500) as loop:
            for cycle in loop:
                if cycle.time >= 2.0:
                    break
            assert len(loop.log) == 1500
        with pytest.raises(ValueError, match="log=0 cycles"):
            cat.Loop(arm, period=1e-3, log=0)


def test_closing_the_main_device_leaves_an_open_loop_first() -> None:
    segment = Segment([Servo()])
    main = cat.MainDevice(segment)
    main.open()
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
    loop = cat.Loop(arm)
    loop.__enter__()
    next(loop)
    main.close()
    assert segment[0].state & 0x0F == 1
    loop.__exit__(None, None, None)


def test_uncommitted_requests_have_no_effect_after_the_stop() -> None:
    """An exception right after `enable`: the axis stays off while the loop is being left."""
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with contextlib.suppress(ZeroDivisionError), cat.Loop(arm, enable=False) as loop:
            for cycle in loop:
                if cycle.number == 5:
                    arm.enable()
                    raise ZeroDivisionError
        assert segment[0].drive_state() == "SWITCH ON DISABLED"


def test_a_fault_in_a_missed_cycle_is_raised() -> None:
    segment = Segment([Servo()])

    def run() -> None:
        with cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 10:
                    segment[0].inject_fault(0x2310)
                    cycle.spend(8e-3)
                if cycle.number == 20:
                    break

    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with pytest.raises(DriveError, match="0x2310"):
            run()


def test_a_period_longer_than_a_second() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, period=1.5, watchdog=5.0, stop=cat.StopPolicy(late_limit=0)) as loop:
            assert next(loop).ok
            assert next(loop).ok
