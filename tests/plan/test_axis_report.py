"""Axes in the plan: their section of the report, and times that CST does not allow."""

import math

import pytest

from catenary.plan.axis_report import AxisReport
from catenary.plan.options import PlanOptions
from catenary.plan.planner import make_plan
from catenary.plan.request import ImageLayout, RequestTables
from tests.plan.devices import Asking, demo


class Reports(Asking):
    """A request that only reports axes."""

    def tables(self, layout: ImageLayout) -> RequestTables:
        return RequestTables(
            axes=(),
            axis_reports=(
                AxisReport("2 Servo", (8, 10), ("on_loss: disable",)),
                AxisReport("3 Servo", (9,), ()),
            ),
        )


def test_the_report_has_a_section_of_axes() -> None:
    text = str(make_plan(demo(), [Reports({})], PlanOptions(late_limit_position=0, handover=0.005)))
    assert (
        "axes: late limit CSP off, CSV 50 ms, CST 10 ms; "
        "CST keeps its torque for 5 ms after a law or stream ended\n"
        "    in the background, an update is valid for 200 ms in CSV and PV, 20 ms in CST\n"
        "    axis 0  2 Servo  CSP, CST\n"
        "        on_loss: disable\n"
        "    axis 1  3 Servo  CSV\n"
    ) in text
    assert "axes: late limit" not in str(make_plan(demo()))


def test_a_late_limit_of_zero_is_refused_in_cst() -> None:
    with pytest.raises(ValueError, match="2 Servo: late_limit=0 is refused with CST"):
        make_plan(demo(), [Reports({})], PlanOptions(late_limit_torque=0))
    plan = make_plan(demo(), options=PlanOptions(late_limit_torque=0))
    assert plan.cycle.late_limit_torque_ns == 0


@pytest.mark.parametrize("handover", [0.0, -1.0, math.inf, math.nan])
def test_the_handover_must_be_a_time(handover: float) -> None:
    with pytest.raises(ValueError, match="must be positive and finite"):
        make_plan(demo(), options=PlanOptions(handover=handover))
