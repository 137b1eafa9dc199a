"""The phase controller, compared with its twin and tested against clocks that drift."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from catenary.core import Clock, PhaseController
from catenary.plan.cycle import ClockPlan
from tests.core.phase_twin import Twin

PERIOD = 1_000_000
PLAN = ClockPlan(
    follow="reference",
    reference=0,
    reference_station=0x1001,
    followers=(1, 2),
    stations=(0x1002, 0x1003),
    phase_ns=700_000,
    wire_ns=50_000,
    allowance_ns=250_000,
    bandwidth=0.01,
    rate_limit_ns=1000.0,
    drift_limit_ns=800.0,
    step_ns=PERIOD // 8,
    bound_ns=1000,
)

ERRORS = st.none() | st.one_of(st.integers(-2000, 2000), st.integers(-PERIOD // 2, PERIOD // 2 - 1))


@given(st.lists(st.tuples(ERRORS, st.integers(1, 20)), max_size=60))
@example([(125_001, 19), (16, 1), (None, 45)])  # the rest is 1 - 2e-16 ns in one of them
def test_as_its_twin_does(runs: list[tuple[int | None, int]]) -> None:
    """The sums agree: the last digit of a float may move 1 ns into the next cycle."""
    compiled, twin = PhaseController(PLAN, PERIOD), Twin(PLAN, PERIOD)
    ahead = 0
    for number, error in enumerate(error for error, count in runs for _ in range(count)):
        ahead += compiled.step(error) - twin.step(error)
        assert abs(ahead) <= 1, number
    assert compiled.jumps == twin.jumps
    assert compiled.drift == pytest.approx(twin.drift)


def phases(
    controller: PhaseController, *, ppm: float, jitter: int = 0, delay: int = 1, cycles: int = 4000
) -> list[float]:
    """Phase errors of a loop whose clock is `ppm` slower than the reference; an answer is used
    `delay` cycles late, and tells the time within `jitter` ns."""
    random = Random(1)
    phase, errors, pipeline = 300_000.0, [], [0] * delay
    for _ in range(cycles):
        error = (phase + PERIOD / 2) % PERIOD - PERIOD / 2
        errors.append(error)
        seen = round(error) + random.randint(-jitter, jitter)
        seen = (seen + PERIOD // 2) % PERIOD - PERIOD // 2
        pipeline.append(controller.step(seen))
        phase += pipeline.pop(0) + PERIOD * ppm * 1e-6
    return errors


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("ppm", [-200.0, 0.0, 200.0])
def test_it_finds_phase_and_rate(ppm: float, delay: int) -> None:
    controller = PhaseController(PLAN, PERIOD)
    errors = phases(controller, ppm=ppm, delay=delay)
    assert max(map(abs, errors[500:])) < 100
    assert max(map(abs, errors[3000:])) < 5
    assert controller.drift == pytest.approx(-ppm * 1e-6 * PERIOD, abs=0.5)
    assert controller.jumps == 0


def test_it_smooths_the_time_of_the_reference() -> None:
    errors = phases(PhaseController(PLAN, PERIOD), ppm=100.0, jitter=1000)
    assert max(map(abs, errors[1000:])) < 400


def test_a_period_never_differs_by_more_than_the_limit() -> None:
    controller = PhaseController(PLAN, PERIOD)
    controller.step(0)
    for _ in range(2000):
        assert abs(controller.step(100_000)) <= PLAN.rate_limit_ns + 1


def test_what_cannot_be_corrected_does_not_wind_it_up() -> None:
    """After a long time at the limit, the error's other sign is followed at once."""
    controller = PhaseController(PLAN, PERIOD)
    controller.step(0)
    for _ in range(20_000):
        controller.step(100_000)
    assert abs(controller.drift) <= PLAN.drift_limit_ns
    moved = [controller.step(-100_000) for _ in range(100)]
    assert moved[0] > 0


def test_single_strays_change_nothing() -> None:
    steady, disturbed = PhaseController(PLAN, PERIOD), PhaseController(PLAN, PERIOD)
    for number in range(200):
        expected = steady.step(None if number % 20 == 10 else 10)
        assert disturbed.step(400_000 if number % 20 == 10 else 10) == expected


@pytest.mark.parametrize("jump", [-400_000, 400_000])
def test_a_clock_that_jumps_is_followed_within_the_limit(jump: int) -> None:
    controller = PhaseController(PLAN, PERIOD)
    phases(controller, ppm=50.0)
    error, moves, errors = float(jump), [], []
    for _ in range(2000):
        moves.append(controller.step(round(error)))
        error += moves[-1] + 50
        errors.append(abs(error))
    assert controller.jumps == 1
    assert max(map(abs, moves)) <= PLAN.rate_limit_ns + 1
    assert errors[450] < 60_000  # 400 us at 1 us a cycle, and eight cycles to believe it
    assert max(errors[1500:]) < 100


def test_it_coasts_at_the_rate_it_found() -> None:
    controller = PhaseController(PLAN, PERIOD)
    phases(controller, ppm=150.0)
    moved = sum(controller.step(None) for _ in range(100))
    assert moved == pytest.approx(-150 * 100, abs=20)


@pytest.mark.parametrize(
    "wrong",
    [
        {"bandwidth": 0.0},
        {"bandwidth": 1.0},
        {"rate_limit_ns": PERIOD * 1.0},
        {"drift_limit_ns": 2000.0},
        {"step_ns": 0},
        {"follow": "nobody"},
        {"phase_ns": PERIOD},
    ],
    ids=str,
)
def test_impossible_plans_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="clock"):
        Clock(replace(PLAN, **wrong), PERIOD)  # type: ignore[arg-type]
