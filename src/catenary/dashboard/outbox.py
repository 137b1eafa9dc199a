"""Bounded queue of the messages to one client."""

from __future__ import annotations

import asyncio
from collections import deque

from catenary.dashboard.frames import Frame

FRAMES_MAX = 4 << 20  # bytes; further frames are dropped
TEXTS_MAX = 4 << 20  # bytes; a client that does not read them is disconnected


class Outbox:
    """Queue of messages. Frames are dropped if the client is slow; texts are not.

    `overflow`: True if the texts exceed their limit.
    """

    def __init__(self) -> None:
        self.overflow = False
        self._queue: deque[bytes | str] = deque()
        self._frames = self._texts = 0  # bytes in the queue
        self._dropped: dict[int, int] = {}  # rows, by id of the subscription
        self._filled = asyncio.Event()

    @property
    def size(self) -> int:
        """Size of the waiting messages [bytes]."""
        return self._frames + self._texts

    def put_text(self, text: str) -> None:
        """Append a message."""
        self._texts += len(text)
        self.overflow = self.overflow or self._texts > TEXTS_MAX
        if not self.overflow:
            self._append(text)

    def put_frame(self, id: int, frame: Frame) -> None:
        """Append a frame, or drop it. The next frame reports the dropped rows as lost.

        Args:
            id: number of the subscription.
            frame: the frame.
        """
        if self._frames + len(frame.body) > FRAMES_MAX:
            self._dropped[id] = self._dropped.get(id, 0) + frame.lost + frame.rows
            return
        data = frame.for_subscription(id, self._dropped.pop(id, 0))
        self._frames += len(data)
        self._append(data)

    def put_latest(self, data: bytes) -> None:
        """Append binary data that later ones replace, unless earlier messages wait."""
        if len(self._queue) < 4:
            self._frames += len(data)
            self._append(data)

    def put_if_idle(self, text: str) -> None:
        """Append a message that later ones replace, unless earlier messages wait."""
        if len(self._queue) < 4:
            self.put_text(text)

    async def next(self) -> bytes | str:
        """Wait for the next message, and remove it."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        data = self._queue.popleft()
        if isinstance(data, bytes):
            self._frames -= len(data)
        else:
            self._texts -= len(data)
        return data

    def _append(self, data: bytes | str) -> None:
        self._queue.append(data)
        self._filled.set()
