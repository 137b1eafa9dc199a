"""Bounded queue of the messages to one client."""

from __future__ import annotations

import asyncio
from collections import deque

from catenary.dashboard.frames import Frame

FRAMES_MAX = 4 << 20  # bytes; further frames are dropped
TEXTS_MAX = 4 << 20  # bytes; a client that does not read them is disconnected


class Outbox:
    """Queue of messages. Texts precede frames, so that a slow client has fresh tokens and statuses.

    Frames are dropped if the client is slow; texts are not.

    `overflow`: True if the texts exceed their limit.
    """

    def __init__(self) -> None:
        self.overflow = False
        self._waiting_texts: deque[str] = deque()
        self._waiting_frames: deque[bytes] = deque()
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
            self._waiting_texts.append(text)
            self._filled.set()

    def put_frame(self, id: int, frame: Frame) -> None:
        """Append a frame, or drop it. The next frame reports the dropped rows as lost.

        Args:
            id: number of the subscription.
            frame: the frame.
        """
        if self._frames + len(frame.body) > FRAMES_MAX:
            self._dropped[id] = self._dropped.get(id, 0) + frame.lost + frame.rows
            return
        self._append(frame.for_subscription(id, self._dropped.pop(id, 0)))

    def put_latest(self, data: bytes) -> None:
        """Append binary data that later ones replace, unless earlier messages wait."""
        if len(self._waiting_frames) < 4:
            self._append(data)

    def put_if_idle(self, text: str) -> None:
        """Append a message that later ones replace, unless earlier messages wait."""
        if len(self._waiting_texts) < 4:
            self.put_text(text)

    def drop_frames(self) -> None:
        """Remove the waiting frames, because their layout has ended."""
        self._waiting_frames.clear()
        self._dropped.clear()
        self._frames = 0

    async def next(self) -> bytes | str:
        """Wait for the next message, and remove it."""
        while not (self._waiting_texts or self._waiting_frames):
            self._filled.clear()
            await self._filled.wait()
        if self._waiting_texts:
            text = self._waiting_texts.popleft()
            self._texts -= len(text)
            return text
        data = self._waiting_frames.popleft()
        self._frames -= len(data)
        return data

    def _append(self, data: bytes) -> None:
        self._frames += len(data)
        self._waiting_frames.append(data)
        self._filled.set()
