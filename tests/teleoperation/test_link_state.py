from __future__ import annotations

from itertools import product

import pytest

from catenary.teleoperation.link_state import LinkEvent, LinkState, step

W, C, L = LinkState.WAITING, LinkState.CONNECTED, LinkState.LOST


@pytest.mark.parametrize(
    ("state", "event", "after"),
    [
        (W, LinkEvent.OVERDUE, W),
        (W, LinkEvent.TIMELY, W),
        (W, LinkEvent.STEADY, C),
        (C, LinkEvent.OVERDUE, L),
        (C, LinkEvent.TIMELY, C),
        (C, LinkEvent.STEADY, C),
        (L, LinkEvent.OVERDUE, L),
        (L, LinkEvent.TIMELY, L),
        (L, LinkEvent.STEADY, C),
    ],
)
def test_each_pair(state: LinkState, event: LinkEvent, after: LinkState) -> None:
    assert step(state, event) is after


def test_a_link_never_waits_again() -> None:
    for state, event in product((C, L), LinkEvent):
        assert step(state, event) is not W
