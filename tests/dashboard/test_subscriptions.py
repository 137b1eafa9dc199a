"""Limits of the subscriptions of one client."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from catenary.dashboard.frames import Frame
from catenary.dashboard.messages import Subscribe
from catenary.dashboard.subscriptions import MEMBERS_MAX, SIGNALS_MAX, Subscriptions
from catenary.share import ShareLayout

FIELDS = [SimpleNamespace(name="position", shape=(256,))]
LAYOUT = cast(ShareLayout, SimpleNamespace(name="test", fields=FIELDS, period=1e-3))


def ignore(id: int, frame: Frame) -> None:
    """Drop a frame."""


def subscribe(subscriptions: Subscriptions, client: object, id: int, signals: int = 1) -> None:
    names = [f"position[{k}]" for k in range(signals)]
    subscriptions.add(client, Subscribe(id=id, signals=names, full=True), ignore, 0)


def test_a_client_cannot_take_the_subscriptions_of_others() -> None:
    subscriptions, hostile, other = Subscriptions(LAYOUT), object(), object()
    for id in range(MEMBERS_MAX):
        subscribe(subscriptions, hostile, id)
    with pytest.raises(ValueError, match=f"at most {MEMBERS_MAX} subscriptions"):
        subscribe(subscriptions, hostile, MEMBERS_MAX)
    subscribe(subscriptions, other, 1)
    subscribe(subscriptions, hostile, 0)  # replaces its own


def test_the_signals_of_a_client_are_limited() -> None:
    subscriptions, client = Subscriptions(LAYOUT), object()
    for id in range(SIGNALS_MAX // 256):
        subscribe(subscriptions, client, id, 256)
    with pytest.raises(ValueError, match=f"{SIGNALS_MAX} signals"):
        subscribe(subscriptions, client, 99)
    subscriptions.remove(client, 0)
    subscribe(subscriptions, client, 99)
