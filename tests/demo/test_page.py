import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from catenary.demo.page import as_html, drawn_range
from catenary.demo.result import PHASES, Device, Motion, Result, as_json
from catenary.figures import FIGURES
from catenary.loop.timing import Timing

VOID = {"meta", "link", "br", "img", "rect", "path", "polyline"}


@pytest.fixture
def result() -> Result:
    time = np.arange(2000) * 1e-3
    reference = np.stack([np.sin(time + phase) for phase in (0.0, 1.0, 2.0)], axis=1)
    figures = dict(zip(FIGURES, (2e-6, 9e-6, 1e-6, 5e-7, 2e-6, 4e-6, 5e-6), strict=True))
    buckets = [(1e-6, 2e-6, 1000), (2e-6, 3e-6, 999), (8e-6, 9e-6, 1)]
    counters = {"cycles": 2000, "late": 1, "uncommitted": 2, "underrun": 0, "lost": 0}
    phases = {phase: {"count": 2000, **figures} for phase in PHASES}
    return Result(
        devices=[Device(0, "A & B <coupler>", 2, 0x044C2C52, "OP")],
        period=1e-3,
        cycles=2000,
        timing=Timing(phases, counters, period=1e-3, scheduling="SCHED_OTHER"),
        histograms={phase: buckets for phase in PHASES},
        motion=Motion(time, reference, np.roll(reference, 2, axis=0) + 0.01),
        link="veth",
        scheduling="SCHED_OTHER",
    )


class Balance(HTMLParser):
    """Parser that checks that all tags are closed in the right order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def test_json_has_the_documented_keys(result: Result) -> None:
    read = json.loads(as_json(result))
    assert list(read) == [
        "devices",
        "cycles",
        "late",
        "uncommitted",
        "underrun",
        "lost",
        "verdict",
        "tracking_error_rad",
        "transport_delay_s",
        "timing_us",
        "link",
        "scheduling",
    ]
    assert read["devices"][0] == {
        "position": 0,
        "name": "A & B <coupler>",
        "vendor": 2,
        "product": 0x044C2C52,
        "state": "OP",
    }
    assert set(read["timing_us"]) == set(PHASES)
    assert all(set(figures) == set(FIGURES) for figures in read["timing_us"].values())
    assert read["tracking_error_rad"] == {"rms": 0.01, "max": 0.01}
    assert read["transport_delay_s"] == 2e-3
    assert (read["late"], read["uncommitted"]) == (1, 2)
    assert read["timing_us"]["period"]["max"] == 9.0


def test_the_error_refers_to_the_set_point_at_the_drive() -> None:
    time = np.array([0.0, 1e-3, 2e-3, 6e-3, 7e-3])  # the program missed three cycles
    reference = np.array([[0.0], [1.0], [2.0], [3.0], [4.0]])
    error = Motion(time, reference, np.zeros_like(reference)).error(2e-3)
    assert np.isnan(error[:2]).all()
    assert error[2:, 0].tolist() == [0.0, -2.0, -2.0]


def test_the_page_is_well_formed_and_self_contained(result: Result) -> None:
    page = as_html(result)
    balance = Balance()
    balance.feed(page)
    assert balance.open == []
    assert not re.search(r"https?:|url\(|<script|<link|@import", page)
    assert "A &amp; B &lt;coupler&gt;" in page
    assert "it affects; longer in 2 uncommitted cycles." in page
    assert page.count("<svg") == 2 + len(PHASES)
    assert not [name for name in re.findall(r"<(?:th|b)\b[^>]*>([^<]*)", page) if "_" in name]


def test_an_outlier_does_not_compress_a_histogram() -> None:
    buckets = [(float(n), n + 1.0, 500) for n in range(10)] + [(900.0, 901.0, 1)]
    low, high = drawn_range(buckets)
    assert low == 0.0
    assert 10.0 < high < 12.0


def test_a_page_of_a_run_without_motion(result: Result) -> None:
    empty = Motion(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    short = Result(**{name: getattr(result, name) for name in result.__slots__} | {"motion": empty})
    assert "The run was too short" in as_html(short)
    assert json.loads(as_json(short))["tracking_error_rad"] == {"rms": 0.0, "max": 0.0}
