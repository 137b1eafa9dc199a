"""A link written in Python, in virtual time: sent frames return after a latency.

Its table is filled with ctypes callbacks, so that the compiled wrappers are tested over a link they
do not know.
"""

from __future__ import annotations

import ctypes

from tests.link_table import (
    NOW,
    RECEIVE,
    SEND,
    VIRTUAL_TIME,
    WAIT_UNTIL,
    Table,
    capsule_of,
)


class PythonLink:
    """Owns the frames under way. `sent` lists what reached it."""

    name = "python"

    def __init__(self, *, latency_ns: int = 1000, flags: int = VIRTUAL_TIME) -> None:
        self.time = 0
        self.latency_ns = latency_ns
        self.sent: list[bytes] = []
        self.under_way: list[tuple[int, bytes]] = []
        self.closed = False
        self.lent = ctypes.create_string_buffer(1514)
        self.table = Table(
            1,
            flags,
            None,
            SEND(self.table_send),
            RECEIVE(self.table_receive),
            NOW(lambda _: self.time),
            WAIT_UNTIL(self.table_wait_until),
        )
        self.capsule_name = b"catenary.link"
        self.capsule = capsule_of(self.table, self.capsule_name)

    def table_send(self, _, frame, length) -> int:
        self.sent.append(bytes(frame[:length]))
        self.under_way.append((self.time + self.latency_ns, self.sent[-1]))
        return 0

    def table_receive(self, _, frame) -> int:
        if not self.under_way or self.under_way[0][0] > self.time:
            return 0
        _, answer = self.under_way.pop(0)
        ctypes.memmove(self.lent, answer, len(answer))
        frame[0] = ctypes.cast(self.lent, ctypes.POINTER(ctypes.c_uint8))
        return len(answer)

    def table_wait_until(self, _, deadline, wake_on_frame) -> int:
        if wake_on_frame and self.under_way and self.under_way[0][0] <= deadline:
            self.time = max(self.time, self.under_way[0][0])
            return 1
        self.time = max(self.time, deadline)
        return 0

    def close(self) -> None:
        self.closed = True


def frame(payload: bytes, *, index: int = 0) -> bytes:
    """A frame of one NOP datagram with `payload`."""
    size = len(payload)
    datagram = bytes([0, index]) + bytes(4) + size.to_bytes(2, "little") + bytes(2) + payload
    header = ((size + 12) | 0x1000).to_bytes(2, "little")
    return b"\xff" * 6 + b"\x02\0\0\0\0\1" + b"\x88\xa4" + header + datagram + bytes(2)
