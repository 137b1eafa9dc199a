from __future__ import annotations

import pytest

from catenary.bench import verdict
from catenary.bench.statistics import combine
from tests.bench.test_statistics import LATENESS, make_round


@pytest.mark.parametrize(
    ("delay_us", "lost", "status"),
    [(100, 0, "PASS"), (101, 0, "WARN"), (60, 1, "WARN"), (500, 0, "WARN"), (501, 0, "FAIL")],
)
def test_verdict_by_output_delay_and_lost_cycles(delay_us: int, lost: int, status: str) -> None:
    run = combine("catenary-inline", [make_round(0, delay_us * 1000 - LATENESS, 0, lost)])
    assert verdict.status_of(run, 1000.0) == status
    share = f"{delay_us / 10:.1f}% of the period; {lost} of 100 cycles lost"
    assert verdict.as_text([run], 1000).endswith(share)
