"""What Loop refuses before it touches the segment."""

import contextlib

import pytest

import catenary as cat
from catenary.errors import DriveError
from catenary.virtual import Segment, Servo


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        ({"busy_wait": 1e-3}, "less than the period"),
        ({"busy_wait": -1e-6}, "less than the period"),
        ({"collect_deadline": 1.5}, "share of the period"),
        ({"run": "fast"}, "threaded"),
    ],
)
def test_refuses_what_cannot_be(asked: dict, named: str) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with pytest.raises(ValueError, match=named):
            cat.Loop(arm, period=1e-3, **{"run": "inline", **asked})


def test_the_log_reaches_back_as_far_as_asked() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3, run="inline", log=1500) as loop:
            for cycle in loop:
                if cycle.time >= 2.0:
                    break
            assert len(loop.log) == 1500
        with pytest.raises(ValueError, match="log=0 cycles"):
            cat.Loop(arm, period=1e-3, log=0)


def test_a_main_device_that_is_closed_round_an_open_loop_leaves_it_first() -> None:
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


def test_what_was_asked_and_not_committed_does_not_come_after_the_stop() -> None:
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


def test_a_fault_in_a_cycle_that_python_has_missed_is_raised_all_the_same() -> None:
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
        with cat.Loop(arm, period=1.5, watchdog=5.0, late_limit=0) as loop:
            assert next(loop).ok
            assert next(loop).ok
