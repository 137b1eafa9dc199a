"""The table of a humanoid's networks and tasks: its shape, and a run as short as can be."""

from __future__ import annotations

import json

import pytest

from benchmarks.tables import humanoid_tasks
from benchmarks.tables.sheet import Options, as_json, show
from tests.benchmarks.patience import patiently


def test_the_rates_of_the_stand_ins_follow_the_loop() -> None:
    rates = {each.name: each.rate(4000) for each in humanoid_tasks.STAND_INS}
    assert rates == {"dynamics": 4000, "estimator": 2000, "balance": 1000, "status": 1}


def test_what_is_left_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    text = show(humanoid_tasks.measure(Options(refused="not here")))
    assert "left out: all of ours: no private network (not here)" in text
    monkeypatch.setattr(humanoid_tasks, "find_spec", lambda _name: None)
    assert "Numba" in humanoid_tasks.why_not(Options())


@pytest.mark.usefixtures("veth")
def test_it_runs_briefly() -> None:
    options = Options(seconds=0.4, rates=(250,), axes=(2, 1))
    sheet = patiently(lambda: humanoid_tasks.measure(options))
    [rate] = json.loads(as_json("humanoid_tasks", sheet))["rates"]
    assert [column["name"] for column in rate["columns"]] == ["laws, upper", "laws, lower"]
    assert all(column["cycles"] > 0 for column in rate["columns"])
    names = ["dynamics", "estimator", "balance", "status"]
    assert [task["name"] for task in rate["tasks"]] == names
    assert rate["tasks"][0]["jobs"] > rate["tasks"][2]["jobs"] > 0
    assert set(rate["holds"]) <= {"laws, upper", "laws, lower", *names}
