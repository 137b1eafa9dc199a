"""State machine of a link, as a table."""

from __future__ import annotations

from enum import Enum


class LinkState(Enum):
    """State of a link, as one side sees it."""

    WAITING = "waiting"  # not connected since the start
    CONNECTED = "connected"
    LOST = "lost"  # was connected; connects again by the same rule as at the start


class LinkEvent(Enum):
    """Result of a cycle for the link."""

    OVERDUE = "the delays are beyond the bound, unknown, or the other side has left"
    TIMELY = "the delays are within the bound"
    STEADY = "the delays have been within the bound during the whole settling time"


TRANSITIONS = {
    (LinkState.WAITING, LinkEvent.STEADY): LinkState.CONNECTED,
    (LinkState.CONNECTED, LinkEvent.OVERDUE): LinkState.LOST,
    (LinkState.LOST, LinkEvent.STEADY): LinkState.CONNECTED,
}


def step(state: LinkState, event: LinkEvent) -> LinkState:
    """Return the state after an event. Pairs that are not in the table keep the state."""
    return TRANSITIONS.get((state, event), state)
