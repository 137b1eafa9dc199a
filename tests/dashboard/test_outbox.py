"""Queue of one client: bounded, and honest about dropped rows."""

from __future__ import annotations

import asyncio

from catenary.dashboard.frames import Frame
from catenary.dashboard.outbox import FRAMES_MAX, TEXTS_MAX, Outbox
from tests.dashboard.serving import decode_frame

ROWS = 8000
FRAME = Frame(1, ROWS, 1, 0, 1, 1e-3, bytes(2 * 8 * ROWS))


def taken(outbox: Outbox) -> bytes | str:
    return asyncio.run(asyncio.wait_for(outbox.next(), 1.0))


def test_a_slow_client_loses_frames_but_no_memory() -> None:
    outbox = Outbox()
    for _ in range(1000):
        outbox.put_frame(3, FRAME)
    assert outbox.size <= FRAMES_MAX + 1000 * 32
    assert not outbox.overflow


def test_the_next_frame_reports_the_dropped_rows() -> None:
    outbox = Outbox()
    for _ in range(100):
        outbox.put_frame(3, FRAME)
    kept = 0
    while outbox.size:
        data = taken(outbox)
        assert isinstance(data, bytes)
        kept += decode_frame(data).rows + decode_frame(data).lost
    outbox.put_frame(4, FRAME)
    outbox.put_frame(3, FRAME)
    other, same = taken(outbox), taken(outbox)
    assert isinstance(other, bytes)
    assert isinstance(same, bytes)
    assert decode_frame(other).lost == 0
    assert kept + decode_frame(same).lost == 100 * ROWS


def test_texts_beyond_the_limit_are_an_overflow() -> None:
    outbox = Outbox()
    for _ in range(TEXTS_MAX // 1000 + 1):
        outbox.put_text("x" * 1000)
    assert outbox.overflow
    assert outbox.size <= TEXTS_MAX + 1000


def test_replaceable_messages_do_not_queue() -> None:
    outbox = Outbox()
    for _ in range(100):
        outbox.put_if_idle("status")
    assert outbox.size < 5 * len("status")


def test_texts_precede_the_frames_of_a_slow_client() -> None:
    outbox = Outbox()
    for _ in range(10):
        outbox.put_frame(3, FRAME)
    outbox.put_text("token")
    outbox.put_if_idle("status")
    assert [taken(outbox), taken(outbox)] == ["token", "status"]
    assert isinstance(taken(outbox), bytes)


def test_dropped_frames_are_not_sent_and_not_reported() -> None:
    outbox = Outbox()
    for _ in range(100):
        outbox.put_frame(3, FRAME)
    outbox.drop_frames()
    assert outbox.size == 0
    outbox.put_frame(3, FRAME)
    data = taken(outbox)
    assert isinstance(data, bytes)
    assert decode_frame(data).lost == 0
