"""The delay by each protocol: medians within rounds, the table, and one short run."""

from __future__ import annotations

import pytest

from benchmarks.protocols import (
    NAMES,
    NOTHING,
    Job,
    Window,
    _rotated,
    as_text,
    once,
    served,
    summary,
)


def window(name: str, send_us: float, lost: int = 0) -> Window:
    return Window(name, send_us, 2 * send_us, 3.0, lost, 0, 10, 0, 100.0)


def test_the_delay_is_the_median_of_the_differences_within_rounds() -> None:
    idle, read = (10.0, 20.0, 30.0), (11.0, 20.5, 35.0)
    windows = [window(NOTHING, each) for each in idle] + [window("FoE read", e, 1) for e in read]
    rows = summary(windows)
    assert list(rows) == [NOTHING, "FoE read"]
    assert rows[NOTHING]["delay_us"] == 0
    assert rows["FoE read"]["delay_us"] == 1.0
    assert rows["FoE read"]["send_us"] == 20.5
    assert (rows["FoE read"]["lost"], rows["FoE read"]["uses"]) == (3, 30)
    assert "all protocols reach it" in as_text(rows)


def test_a_slow_protocol_is_named() -> None:
    rows = summary([window(NOTHING, 10.0), window("AoE read", 11.5)])
    assert as_text(rows).endswith("at most 1.0 us: above: AoE read")


def test_a_protocol_without_a_completed_use_is_named() -> None:
    unused = Window("AoE read", 10.0, 20.0, 3.0, 0, 0, 0, 0, 100.0)
    text = as_text(summary([window(NOTHING, 10.0), unused]))
    assert text.endswith("without a completed use: AoE read")


def test_the_order_rotates() -> None:
    orders = [_rotated(number) for number in range(len(NAMES))]
    assert {order[0] for order in orders} == set(NAMES)
    assert all(sorted(order) == sorted(NAMES) for order in orders)


@pytest.mark.usefixtures("veth")  # for its reason to skip
def test_a_short_run_uses_every_protocol() -> None:
    with served(3) as interface:
        found = once(interface, Job(1, 300, "threaded", None))
    assert [each.name for each in found.windows] == list(NAMES)
    assert all(each.uses > 0 for each in found.windows[1:])
    assert found.windows[0].uses <= 1  # one may end after the change
