"""Notifications of a virtual ADS device: values that it sends on its own, ETG.1020."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace

from catenary.virtual.aoe.messages import HEADER_SIZE, Head
from catenary.virtual.protocols import Surroundings

AOE_PROTOCOL = 1
NO_MODE, NO_HANDLE, NO_MORE, NO_MEMORY = 0x713, 0x714, 0x716, 0x70A
CYCLIC, ON_CHANGE = 3, 4
LIMIT = 16  # notifications of a device
PERIOD_MIN = 10_000  # [100 ns]
OVERHEAD = 8 + 12 + 8  # of one sample in a message [bytes]


@dataclass
class _Notification:
    message: Head
    place: tuple[int, int, int]  # index group, index offset, size
    on_change: bool
    period_ns: int
    last: bytes | None = None


class Notifications:
    """Owner of the notifications of one device. The device stops them when it enters INIT."""

    def __init__(self, surroundings: Surroundings, read: Callable[[int, int, int], bytes]) -> None:
        self._around = surroundings
        self._read = read
        self._active: dict[int, _Notification] = {}
        self._last_handle = 0

    def clear(self) -> None:
        """End all notifications. The next handle is 1 again."""
        self._active.clear()
        self._last_handle = 0

    def add(
        self, message: Head, place: tuple[int, int, int], mode: int, cycle: int
    ) -> tuple[int, int]:
        """Start a notification.

        Args:
            message: Header of the notifications.
            place: Index group, index offset and size of the value.
            mode: Transmission mode.
            cycle: Time between two checks of the value [100 ns].

        Returns:
            The error code, or 0, and the handle.
        """
        if mode not in (CYCLIC, ON_CHANGE):
            return NO_MODE, 0
        if len(self._active) >= LIMIT:
            return NO_MORE, 0
        if place[2] + HEADER_SIZE + OVERHEAD > self._around.send_room:
            return NO_MEMORY, 0
        self._last_handle += 1
        period_ns = max(cycle, PERIOD_MIN) * 100
        added = _Notification(message, place, mode == ON_CHANGE, period_ns)
        self._active[self._last_handle] = added
        self._schedule(self._last_handle, added)
        return 0, self._last_handle

    def delete(self, handle: int) -> int:
        """End a notification. Return the error code, or 0."""
        return NO_HANDLE if self._active.pop(handle, None) is None else 0

    def _schedule(self, handle: int, found: _Notification) -> None:
        self._around.scheduler.after(found.period_ns, lambda: self._send(handle, found))

    def _send(self, handle: int, found: _Notification) -> None:
        if self._active.get(handle) is not found:
            return  # it has ended; another one may have its handle
        if self._around.state() not in (2, 4, 8):  # INIT or BOOT: no AoE
            self.clear()
            return
        data = self._read(*found.place)
        if not found.on_change or data != found.last:
            found.last = data
            time = self._around.scheduler.now // 100
            sample = struct.pack("<QIII", time, 1, handle, len(data)) + data
            body = struct.pack("<II", len(sample) + 4, 1) + sample
            head = replace(found.message, length=len(body)).encode()
            self._around.mailbox.send(AOE_PROTOCOL, head + body)
        self._schedule(handle, found)
