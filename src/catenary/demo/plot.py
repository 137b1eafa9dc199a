"""Plots as inline SVG, without scripts or external files.

Colours come from classes of the page's style sheet, so that a plot suits light and dark mode.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

Bucket = tuple[float, float, int]  # lower, upper, count

LEFT, RIGHT, TOP, BOTTOM = 44.0, 14.0, 24.0, 22.0  # margins [px]


@dataclass(frozen=True, slots=True)
class Frame:
    """Approximate size of a plot on the page [px]."""

    width: float
    height: float

    @property
    def right(self) -> float:
        return self.width - RIGHT

    @property
    def bottom(self) -> float:
        return self.height - BOTTOM


WIDE = Frame(1060.0, 260.0)
SMALL = Frame(256.0, 170.0)


@dataclass(frozen=True, slots=True)
class Line:
    name: str
    style: str  # a class of the style sheet
    x: Sequence[float]
    y: Sequence[float]


@dataclass(frozen=True, slots=True)
class Axis:
    """Axis of a plot, which maps values to pixels. `decades` is True for a logarithmic axis."""

    low: float
    high: float
    start: float  # [px]
    end: float  # [px]
    decades: bool = False

    def pixel(self, value: float) -> float:
        part = (self._scaled(value) - self._scaled(self.low)) / (
            self._scaled(self.high) - self._scaled(self.low)
        )
        return self.start + min(max(part, 0.0), 1.0) * (self.end - self.start)

    def _scaled(self, value: float) -> float:
        return math.log10(max(value, self.low)) if self.decades else value

    def ticks(self) -> list[float]:
        if self.decades:
            first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
            return [10.0**power for power in range(first, last + 1)]
        step = nice_step(self.high - self.low)
        first = math.ceil(self.low / step - 1e-9)
        return [step * n for n in range(first, math.floor(self.high / step + 1e-9) + 1)]


def nice_step(span: float) -> float:
    """Return the largest step of 1, 2 or 5 times a power of ten that fits three times in `span`."""
    power = 10.0 ** math.floor(math.log10(span / 3.0))
    return next(power * factor for factor in (10, 5, 2, 1) if power * factor <= span / 3.0)


def line_plot(lines: Sequence[Line], *, x_unit: str, y_unit: str, title: str) -> str:
    """Draw lines over a common axis."""
    ys = [value for line in lines for value in line.y]
    margin = max((max(ys) - min(ys)) * 0.06, 1e-9)
    x = Axis(lines[0].x[0], lines[0].x[-1], LEFT, WIDE.right)
    y = Axis(min(ys) - margin, max(ys) + margin, WIDE.bottom, TOP)
    drawn = [polyline(line, x, y) for line in lines]
    return svg(WIDE, title, [*grid(WIDE, x, y, x_unit, y_unit), *drawn])


def polyline(line: Line, x: Axis, y: Axis) -> str:
    points = " ".join(
        f"{x.pixel(a):.1f},{y.pixel(b):.1f}" for a, b in zip(line.x, line.y, strict=True)
    )
    return f'<polyline class="line {line.style}" points="{points}"/>'


def histogram(buckets: Sequence[Bucket], *, low: float, high: float, title: str) -> str:
    """Draw counts over time [us].

    The axis of the counts is logarithmic, so that a single late cycle is visible. Buckets outside
    the range from `low` to `high` [us] are not drawn.
    """
    bars = rebin(inside(buckets, low, high), low, high, 48)
    x = Axis(low, high, LEFT, SMALL.right)
    tallest = max(count for *_, count in bars)
    y = Axis(0.7, max(10.0, 1.3 * tallest), SMALL.bottom, TOP, decades=True)
    drawn = [bar(bucket, x, y) for bucket in bars if bucket[2] > 0]
    return svg(SMALL, title, [*grid(SMALL, x, y, "µs", "cycles"), *drawn])


def inside(buckets: Sequence[Bucket], low: float, high: float) -> list[Bucket]:
    return [bucket for bucket in buckets if bucket[1] > low and bucket[0] < high]


def rebin(buckets: Sequence[Bucket], low: float, high: float, count: int) -> list[Bucket]:
    """Return bars of equal width. The count of a wide bucket is distributed over its bars."""
    width = (high - low) / count
    heights = [0.0] * count
    for lower, upper, amount in buckets:
        first = min(max(int((lower - low) / width), 0), count - 1)
        last = min(max(math.ceil((upper - low) / width) - 1, first), count - 1)
        for place in range(first, last + 1):
            heights[place] += amount / (last - first + 1)
    return [
        (low + n * width, low + (n + 1) * width, math.ceil(height))
        for n, height in enumerate(heights)
    ]


def bar(bucket: Bucket, x: Axis, y: Axis) -> str:
    lower, upper, count = bucket
    left, right, top = x.pixel(lower), x.pixel(upper), y.pixel(count)
    return (
        f'<rect class="bar" x="{left + 0.3:.1f}" y="{top:.1f}" '
        f'width="{right - left - 0.6:.1f}" height="{y.start - top:.1f}">'
        f"<title>{lower:.1f} to {upper:.1f} µs: {count} cycles</title></rect>"
    )


def grid(frame: Frame, x: Axis, y: Axis, x_unit: str, y_unit: str) -> list[str]:
    parts = [label(0, 12, y_unit, "start")]
    for value in y.ticks():
        at = y.pixel(value)
        parts.append(f'<path class="grid" d="M{LEFT} {at:.1f}H{frame.right}"/>')
        parts.append(label(LEFT - 6, at + 4, number(value), "end"))
    ticks = x.ticks()
    for value in ticks:
        unit = f" {x_unit}" if value == ticks[-1] else ""
        parts.append(label(x.pixel(value), frame.bottom + 16, number(value) + unit, "middle"))
    parts.append(f'<path class="axis" d="M{LEFT} {frame.bottom}H{frame.right}"/>')
    return parts


def label(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def number(value: float) -> str:
    return f"{value:.10g}".replace("-", "−")


def svg(frame: Frame, title: str, parts: Sequence[str]) -> str:
    return (
        f'<svg viewBox="0 0 {frame.width:.0f} {frame.height:.0f}" role="img" '
        f'aria-label="{escape(title)}">' + "".join(parts) + "</svg>"
    )
