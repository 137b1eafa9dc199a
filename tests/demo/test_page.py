import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from catenary.demo.page import as_html, drawn_range
from catenary.demo.result import FIGURES, PHASES, Device, Motion, Result, as_json

VOID = {"meta", "link", "br", "img", "rect", "path", "polyline"}


@pytest.fixture
def result() -> Result:
    time = np.arange(2000) * 1e-3
    reference = np.stack([np.sin(time + phase) for phase in (0.0, 1.0, 2.0)], axis=1)
    figures = dict(zip(FIGURES, (2.0, 1.0, 9.0, 0.5, 2.0, 4.0, 5.0), strict=True))
    buckets = [(1.0, 2.0, 1000), (2.0, 3.0, 999), (8.0, 9.0, 1)]
    return Result(
        devices=[Device(0, "A & B <coupler>", 2, 0x044C2C52, "OP")],
        period=1e-3,
        cycles=2000,
        lost=0,
        late=1,
        timing_us=dict.fromkeys(PHASES, figures),
        histograms={phase: buckets for phase in PHASES},
        motion=Motion(time, reference, reference + 0.01),
        link="veth",
        scheduling="SCHED_OTHER",
    )


class Balance(HTMLParser):
    """Every tag that is opened is closed in its turn."""

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


def test_json_has_the_published_form(result: Result) -> None:
    read = json.loads(as_json(result))
    assert list(read) == [
        "devices",
        "cycles",
        "lost",
        "late",
        "tracking_error_rad",
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


def test_page_is_well_formed_and_needs_nothing_from_elsewhere(result: Result) -> None:
    page = as_html(result)
    balance = Balance()
    balance.feed(page)
    assert balance.open == []
    assert not re.search(r"https?:|url\(|<script|<link|@import", page)
    assert "A &amp; B &lt;coupler&gt;" in page
    assert page.count("<svg") == 2 + len(PHASES)


def test_one_outlier_does_not_flatten_a_histogram() -> None:
    buckets = [(float(n), n + 1.0, 500) for n in range(10)] + [(900.0, 901.0, 1)]
    low, high = drawn_range(buckets)
    assert low == 0.0
    assert 10.0 < high < 12.0


def test_a_run_without_motion_still_makes_a_page(result: Result) -> None:
    empty = Motion(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    short = Result(**{name: getattr(result, name) for name in result.__slots__} | {"motion": empty})
    assert "Too short a run" in as_html(short)
    assert json.loads(as_json(short))["tracking_error_rad"] == {"rms": 0.0, "max": 0.0}
