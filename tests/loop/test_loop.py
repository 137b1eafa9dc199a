"""What Loop refuses before it touches the segment."""

import pytest

import catenary as cat
from catenary.virtual import Segment, Servo


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        ({"lead": 1e-3}, "less than the period"),
        ({"lead": -1e-6}, "less than the period"),
        ({"run": "fast"}, "threaded"),
    ],
)
def test_refuses_what_cannot_be(asked: dict, named: str) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, mode="csp", counts_per_turn=2**20)
        with pytest.raises(ValueError, match=named):
            cat.Loop(arm, period=1e-3, **{"run": "inline", **asked})


def test_the_lead_is_bounded_by_the_period() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, mode="csp", counts_per_turn=2**20)
        with cat.Loop(arm, period=250e-6, run="inline") as loop:
            assert loop.plan.cycle.lead_ns == 25_000
        with cat.Loop(arm, period=1e-3, lead=0) as loop:
            assert loop.plan.cycle.lead_ns == 0
