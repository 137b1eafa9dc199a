"""Links in Python around that of a virtual segment. They lose, repeat, corrupt or echo frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Self

from catenary.link import Link
from catenary.virtual import Segment


class Meddler:
    """Owns the changes to the frames of a link.

    `meddle` maps the number and the content of a returned frame to the frames that are received.
    """

    def __init__(self, link: Link, meddle: Callable[[int, bytes], list[bytes]]) -> None:
        self._link = link
        self._meddle = meddle
        self._received: deque[bytes] = deque()
        self.count = 0
        self.sent = 0

    @property
    def name(self) -> str:
        return self._link.name

    @property
    def capsule(self) -> object:
        return self._link.capsule

    def open_link(self) -> Self:
        return self

    def send(self, frame: bytes) -> None:
        self.sent += 1
        self._link.send(frame)

    def receive(self) -> bytes | None:
        while (frame := self._link.receive()) is not None:
            self._received.extend(self._meddle(self.count, frame))
            self.count += 1
        return self._received.popleft() if self._received else None

    def now(self) -> int:
        return self._link.now()

    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool:
        if self._received and wake_on_frame:
            return True
        return self._link.wait_until(deadline_ns, wake_on_frame)

    def close(self) -> None:
        self._link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()


class Echo:
    """Owns a clock, and returns every frame unchanged, like `lo`, or no frame."""

    name = "lo"
    capsule = None

    def __init__(self, *, silent: bool = False) -> None:
        self._silent = silent
        self._frames: deque[bytes] = deque()
        self._now = 0

    def open_link(self) -> Self:
        return self

    def send(self, frame: bytes) -> None:
        if not self._silent:
            self._frames.append(frame)

    def receive(self) -> bytes | None:
        return self._frames.popleft() if self._frames else None

    def now(self) -> int:
        return self._now

    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool:
        if self._frames and wake_on_frame:
            return True
        self._now = max(self._now, deadline_ns)
        return False

    def close(self) -> None:
        pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()


def meddled(segment: Segment, meddle: Callable[[int, bytes], list[bytes]]) -> Meddler:
    return Meddler(segment.open_link(), meddle)
