"""The acyclic queue: opaque frames outside the cycle, bounded in both directions."""

import pytest

from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.core.rig import Bench, axis, bench


def request(number: int = 0, size: int = 2, index: int = 0x80) -> bytes:
    return encode_frame([Datagram(EcatCommand.FPRD, number, bytes(size), index=index)])


def lane_frames(b: Bench) -> list[bytes]:
    return [f for f in b.link.sent if decode_frame(f).datagrams[0].index >= 0x80]


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_an_acyclic_frame_is_sent_after_the_cyclic_one_and_returns(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    b.engine.run(1)
    sent = len(b.link.sent)
    assert b.engine.acyclic_push(request(7))
    b.engine.run(2)
    cyclic, acyclic = b.link.sent[sent : sent + 2]
    assert decode_frame(cyclic).datagrams[0].index < 0x80
    assert acyclic == request(7)
    back = b.engine.acyclic_pop()
    assert back is not None
    assert decode_frame(back).datagrams[0].working_counter == 1
    assert b.engine.acyclic_pop() is None
    assert b.ok


def test_at_most_four_a_cycle_in_their_order() -> None:
    b = bench(axis(0))
    for k in range(10):
        assert b.engine.acyclic_push(request(k))
    seen = []
    for _ in range(3):
        before = len(lane_frames(b))
        b.engine.run(1)
        seen.append(len(lane_frames(b)) - before)
    assert seen == [4, 4, 2]
    assert [decode_frame(f).datagrams[0].address for f in lane_frames(b)] == list(range(10))


@pytest.mark.parametrize(
    ("budget_us", "expected"),
    # a frame of 1428 bytes takes 116.16 us; the cyclic ones are back 100 us after the cycle start
    [(0, 1), (100, 1), (330, 1), (333, 2), (448, 2), (449, 3), (900, 4)],
)
def test_only_what_fits_into_the_wire_time_left_and_one_frame_in_any_case(
    budget_us: int, expected: int
) -> None:
    b = bench(axis(0), acyclic_ns=budget_us * 1000)
    for k in range(8):
        assert b.engine.acyclic_push(request(k, size=1400))
    b.engine.run(1)
    assert len(lane_frames(b)) == expected


def test_a_late_body_leaves_less_of_the_wire() -> None:
    b = bench(axis(0), execution="inline", acyclic_ns=900_000)
    b.steps(2)
    for k in range(8):
        assert b.engine.acyclic_push(request(k, size=1400))
    b.engine.spend(600_000)
    b.engine.next()
    assert len(lane_frames(b)) == 2  # 300 us are left


def test_a_negative_wire_time_is_refused() -> None:
    with pytest.raises(ValueError, match="acyclic_ns: -1"):
        bench(axis(0), acyclic_ns=-1)


def test_a_full_queue_refuses() -> None:
    b = bench(axis(0))
    assert [b.engine.acyclic_push(request(k)) for k in range(65)] == [True] * 64 + [False]
    b.engine.run(1)
    assert b.engine.acyclic_push(request(64))


def test_answers_that_are_not_read_are_dropped_and_counted() -> None:
    b = bench(axis(0))
    for k in range(70):
        b.link.arrive(request(k), 1000)
    b.engine.run(1)
    counters = b.engine.counters
    assert (counters["acyclic_received"], counters["acyclic_dropped"]) == (64, 6)
    assert b.ok
    assert sum(b.engine.acyclic_pop() is not None for _ in range(70)) == 64


def test_a_frame_the_link_refuses_is_dropped_and_counted() -> None:
    b = bench(axis(0))
    b.engine.acyclic_push(request())
    b.link.send_result = -105
    b.engine.run(1)
    assert b.engine.counters["acyclic_dropped"] == 1
    assert b.engine.counters["acyclic_sent"] == 0


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (request(index=0x7F), "belongs to the cycle"),
        (request()[:59], "59 bytes"),
        (request() + bytes(1500), "1560 bytes"),
        (request()[:12] + b"\x08\0" + request()[14:], "EtherType"),
    ],
)
def test_what_is_no_acyclic_frame_is_refused(frame: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bench(axis(0)).engine.acyclic_push(frame)


def test_wait_returns_true_if_a_frame_has_returned() -> None:
    b = bench(axis(0))
    assert not b.engine.acyclic_wait(0)
    b.engine.acyclic_push(request())
    b.engine.run(1)
    b.engine.run(1)
    assert b.engine.acyclic_wait(10**12)
