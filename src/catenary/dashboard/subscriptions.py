"""Subscriptions of all clients. Equal ones share one group, which encodes each frame once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from catenary.dashboard.frames import (
    Column,
    Frame,
    Rows,
    encode_decimated,
    encode_full,
    find_columns,
)
from catenary.dashboard.messages import Subscribe
from catenary.share import Reader, ShareLayout

GROUPS_MAX = 256
MEMBERS_MAX, SIGNALS_MAX = 32, 1024  # of one client
ROWS_MAX = 4096  # of a frame
EARLY = 0.008  # [s] half a tick of the hub: the nearest tick sends a frame

Key = tuple[tuple[str, ...], bool, float]
Deliver = Callable[[int, Frame], None]
Member = tuple[object, int]  # the client and the id of its subscription


@dataclass
class Group:
    """Equal subscriptions, with the last cycle that their frames contain."""

    columns: list[Column]
    full: bool
    interval: float  # between frames [s]
    after: int
    due: float
    members: dict[Member, Deliver] = field(default_factory=dict)


class Subscriptions:
    """Owner of the groups of one run of a loop."""

    def __init__(self, layout: ShareLayout) -> None:
        self._layout = layout
        self._groups: dict[Key, Group] = {}

    @property
    def group_count(self) -> int:
        """Number of different subscriptions."""
        return len(self._groups)

    def add(self, client: object, request: Subscribe, deliver: Deliver, newest: int) -> None:
        """Add a subscription. It replaces one of the same client with the same id.

        Args:
            client: identity of the client.
            request: the subscription.
            deliver: receiver of the frames.
            newest: number of the newest cycle; a new group begins after it.

        Raises:
            ValueError: a signal does not exist, or there are too many subscriptions.
        """
        columns = find_columns(self._layout, request.signals)
        self.remove(client, request.id)
        self._check_share_of(client, len(columns))
        key = (tuple(request.signals), request.full, request.rate)
        group = self._groups.get(key)
        if group is None:
            if len(self._groups) >= GROUPS_MAX:
                raise ValueError(f"there are already {GROUPS_MAX} different subscriptions")
            group = Group(columns, request.full, 1.0 / request.rate, newest, 0.0)
            self._groups[key] = group
        group.members[client, request.id] = deliver

    def remove(self, client: object, id: int | None = None) -> None:
        """Remove a subscription of a client.

        Args:
            client: identity of the client.
            id: number of the subscription; None: all of this client.
        """
        for key, group in list(self._groups.items()):
            for member in [m for m in group.members if m[0] is client and id in (None, m[1])]:
                del group.members[member]
            if not group.members:
                del self._groups[key]

    def _check_share_of(self, client: object, signals: int) -> None:
        """Raise ValueError if further signals exceed the limits of a client."""
        sizes = [
            len(group.columns)
            for group in self._groups.values()
            for member in group.members
            if member[0] is client
        ]
        if len(sizes) >= MEMBERS_MAX or sum(sizes) + signals > SIGNALS_MAX:
            raise ValueError(
                f"a client has at most {MEMBERS_MAX} subscriptions and {SIGNALS_MAX} signals"
            )

    def deliver(self, reader: Reader, now: float) -> None:
        """Encode and deliver the frames that are due.

        Args:
            reader: reader of the share.
            now: monotonic time [s].
        """
        known: dict[int, tuple[Rows, int]] = {}
        for group in self._groups.values():
            if now < group.due - EARLY:
                continue
            group.due = max(group.due + group.interval, now)
            if group.after not in known:
                known[group.after] = reader.rows(group.after)
            rows, lost = known[group.after]
            if len(rows):
                group.after = int(rows["number"][-1])
                self._deliver(group, rows, lost)

    def _deliver(self, group: Group, rows: Rows, lost: int) -> None:
        encode = encode_full if group.full else encode_decimated
        for part in np.array_split(rows, -(-len(rows) // ROWS_MAX)):
            frame = encode(part, group.columns, lost, self._layout.period)
            lost = 0
            for (_, id), deliver in list(group.members.items()):
                deliver(id, frame)
