import pytest

from benchmarks.cost import Point, fit


def test_cost_is_found_again() -> None:
    points = [
        Point(n, size, 3.0 + 0.5 * n + 0.002 * size)
        for n, size in ((3, 78), (10, 260), (33, 858), (3, 400), (10, 1000))
    ]
    cost = fit(points)
    assert (cost.base_us, cost.per_axis_us, cost.per_byte_us) == pytest.approx((3.0, 0.5, 0.002))
    assert cost.residual_us == pytest.approx(0.0, abs=1e-9)


def test_cost_of_proportional_segments_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot separate"):
        fit([Point(n, 26 * n, float(n)) for n in (3, 10, 33)])
