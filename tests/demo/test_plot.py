from xml.etree import ElementTree

import pytest

from catenary.demo.plot import Axis, Line, histogram, line_plot, nice_step, rebin

SVG = "{http://www.w3.org/2000/svg}"


def test_rebin_keeps_every_count_of_narrow_buckets() -> None:
    buckets = [(n / 10, (n + 1) / 10, n + 1) for n in range(100)]
    bars = rebin(buckets, 0.0, 10.0, 10)
    assert sum(count for *_, count in bars) == sum(count for *_, count in buckets)
    assert bars[3][2] == sum(range(31, 41))


def test_rebin_distributes_a_wide_bucket() -> None:
    assert [count for *_, count in rebin([(0.0, 4.0, 8)], 0.0, 4.0, 4)] == [2, 2, 2, 2]


@pytest.mark.parametrize(("span", "step"), [(10.0, 2.0), (4.0, 1.0), (0.03, 0.01), (1600.0, 500.0)])
def test_nice_step(span: float, step: float) -> None:
    assert nice_step(span) == pytest.approx(step)


def test_an_axis_clamps_to_its_frame() -> None:
    axis = Axis(0.0, 10.0, 100.0, 200.0)
    assert [axis.pixel(value) for value in (-5.0, 0.0, 5.0, 10.0, 99.0)] == [
        100,
        100,
        150,
        200,
        200,
    ]


def test_a_single_late_cycle_is_drawn() -> None:
    drawn = ElementTree.fromstring(
        histogram([(1.0, 2.0, 10_000), (9.0, 10.0, 1)], low=0.0, high=10.0, title="t")
    )
    heights = [float(bar.get("height", "0")) for bar in drawn.iter("rect")]
    assert len(heights) >= 2
    assert min(heights) > 3.0  # pixels


def test_a_constant_line_is_drawn() -> None:
    flat = Line("flat", "a", [0.0, 1.0, 2.0], [1.0, 1.0, 1.0])
    drawn = ElementTree.fromstring(line_plot([flat], x_unit="s", y_unit="rad", title="t"))
    assert [len(line.get("points", "").split()) for line in drawn.iter("polyline")] == [3]
