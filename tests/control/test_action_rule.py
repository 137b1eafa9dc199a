"""Actions under a rule: held, decaying, neutral, limited; a late policy in another task."""

import math

import numpy as np
import pytest

from catenary import control, realtime

RULE = control.ActionRule(2, low=-1.0, high=[1.0, 2.0], neutral=[0.0, 0.5], hold=0.03, decay=0.1)


def reader(rule: control.ActionRule) -> tuple[realtime.Value, control.ActionReader]:
    value = realtime.Value("f8", rule.outputs)
    return value, control.ActionReader(value, rule)


def test_a_fresh_action_passes_and_is_saturated() -> None:
    value, actions = reader(RULE)
    value.write([0.4, 9.0])
    assert actions.read(0.0).tolist() == [0.4, 2.0]
    assert actions.status.phase == "ok"
    assert str(actions.status) == "ok: 1 actions, 0 refused"


def test_before_the_first_action_the_action_is_neutral() -> None:
    _, actions = reader(RULE)
    assert actions.read(7.0).tolist() == [0.0, 0.5]
    assert (actions.status.phase, actions.status.reason) == ("neutral", "no action yet")
    assert actions.status.age == math.inf


def test_a_late_action_is_held_then_decays_to_neutral_and_returns() -> None:
    value, actions = reader(RULE)
    value.write([1.0, 1.5])
    seen = {now: actions.read(now) for now in (0.0, 0.03, 0.08, 0.105, 0.13, 5.0)}
    assert seen[0.03].tolist() == [1.0, 1.5]
    assert seen[0.08] == pytest.approx([0.5, 1.0])
    assert seen[0.105] == pytest.approx([0.25, 0.75])
    assert seen[0.13] == pytest.approx([0.0, 0.5], abs=1e-12)
    assert seen[5.0].tolist() == [0.0, 0.5]
    assert str(actions.status) == "neutral: no good action for 5 s; 0 refused"
    value.write([1.0, 1.5])
    assert actions.read(5.01).tolist() == [1.0, 1.5]
    assert actions.status.phase == "ok"


def test_the_age_counts_from_the_last_new_value_not_from_the_last_read() -> None:
    value, actions = reader(RULE)
    phases = []
    for k in range(40):
        if k < 10 and k % 5 == 0:  # the policy writes at 0 and 5 ms, then no more
            value.write([1.0, 1.0])
        actions.read(k * 1e-3)
        phases.append(actions.status.phase)
    assert phases == ["ok"] * 36 + ["decaying"] * 4


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        ([0.0, math.nan], "output 1 of 2 is nan"),
        ([-math.inf, 0.0], "output 0 of 2 is -inf"),
    ],
)
def test_a_bad_action_of_the_task_is_refused(bad: list[float], reason: str) -> None:
    value, actions = reader(RULE)
    value.write([0.3, 0.4])
    actions.read(0.0)
    value.write(bad)
    assert actions.read(0.01).tolist() == [0.3, 0.4]
    assert str(actions.status) == f"held: {reason}; 1 refused"
    value.write([0.1, 0.2])
    assert actions.read(0.02).tolist() == [0.1, 0.2]
    assert (actions.status.reason, actions.status.refused) == ("", 1)


def test_a_value_of_another_shape_is_refused() -> None:
    value = realtime.Value("f8", 3)
    actions = control.ActionReader(value, RULE)
    value.write([1.0, 2.0, 3.0])
    assert actions.read(0.0).tolist() == [0.0, 0.5]
    assert actions.status.reason == "the output has shape (3,), expected (2,)"


def test_the_rate_limits_every_change_also_of_the_fallback() -> None:
    rule = control.ActionRule(1, -1.0, 1.0, rate=[10.0], hold=0.02, decay=0.0)
    value, actions = reader(rule)
    seen = []
    for k in range(100):
        if k < 40 or k >= 80:
            value.write([1.0])
        seen.append(actions.read(k * 5e-3)[0])
    steps = np.diff(seen)
    assert seen[0] == 0.0  # no time has passed since the neutral action
    assert abs(steps).max() == pytest.approx(0.05)
    assert seen[39] == 1.0
    assert seen[79] == 0.0
    assert seen[99] == pytest.approx(1.0)


def test_a_clock_that_jumps_back_neither_ages_nor_moves_an_action() -> None:
    rule = control.ActionRule(1, -1.0, 1.0, rate=1.0)
    value, actions = reader(rule)
    value.write([1.0])
    actions.read(10.0)
    before = actions.read(10.02)
    assert actions.read(3.0).tolist() == before.tolist()


@pytest.mark.parametrize("now", [math.nan, math.inf])
def test_a_time_that_is_not_finite_is_refused(now: float) -> None:
    value, actions = reader(RULE)
    value.write([0.1, 0.1])
    with pytest.raises(ValueError, match="is not a time"):
        actions.read(now)
    for later in (1.0, 2.0):  # the action is taken at the next valid time, and then grows old
        seen = actions.read(later)
    assert seen.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"low": 0.1, "high": 1.0},
            "neutral of output 0 is 0.0; it must be finite, and",
        ),
        ({"low": 1.0, "high": -1.0}, "neutral of output 0"),
        ({"low": -1.0, "high": math.inf, "neutral": math.inf}, "neutral of output 0 is inf"),
        ({"low": math.nan, "high": 1.0}, "low of axis 0 is nan"),
        ({"low": -1.0, "high": [1.0, 1.0, 1.0]}, r"high has shape \(3,\)"),
        ({"low": -1.0, "high": 1.0, "rate": 0.0}, "rate of axis 0"),
        ({"low": -1.0, "high": 1.0, "hold": math.nan}, "hold=nan is not a time"),
        ({"low": -1.0, "high": 1.0, "decay": -1.0}, r"decay=-1.0 is not a time"),
    ],
)
def test_invalid_rules_are_named(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.ActionRule(2, **options)
