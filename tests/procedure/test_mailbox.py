"""Mailbox transfers with lost frames: no message is lost or executed twice."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.errors import MailboxError, ResponseTimeout
from catenary.procedure.exchange import After, Procedure, Reply, Request
from catenary.procedure.mailbox import drain
from catenary.procedure.sdo import download, upload
from catenary.wire.coe import UploadRequest
from catenary.wire.mailbox import Mailbox, Type
from tests.procedure.player import Dictionary, MailboxDevice, channel, play

OBJECT = {(0x2000, 0): b"\x11\x22\x33\x44"}


def test_a_lost_read_reply_is_repeated_by_the_toggle() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    device.lose_back = {1}  # 0 is the write, 1 the read
    mailbox = channel()
    assert play(upload(mailbox, 0x2000, 0), device) == OBJECT[0x2000, 0]
    assert device.repeat_requests == 1
    assert len(device.received) == 1


def test_the_toggle_of_an_earlier_channel_does_not_prevent_a_repetition() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    for _ in range(2):
        device.lose_back = {device.accesses + 1}
        mailbox = channel()
        mailbox.counter = len(device.received)  # the device drops a message with the last counter
        assert play(upload(mailbox, 0x2000, 0), device) == OBJECT[0x2000, 0]
    assert device.repeat_requests == 2


def test_a_lost_read_request_is_read_again() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    device.lose_out = {1}
    assert play(upload(channel(), 0x2000, 0), device) == OBJECT[0x2000, 0]


def test_a_lost_write_request_is_written_again() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    device.lose_out = {0}
    assert play(upload(channel(), 0x2000, 0), device) == OBJECT[0x2000, 0]
    assert len(device.received) == 1


def test_a_lost_write_reply_is_not_written_again() -> None:
    dictionary = Dictionary({})
    device = MailboxDevice(dictionary)
    device.deduplicates = False  # like stacks that ignore the counter
    device.lose_back = {0}
    play(download(channel(), 0x2000, 0, b"\x01"), device)
    assert dictionary.written == [(0x2000, 0, b"\x01")]


@settings(max_examples=150, deadline=None)
@given(
    out=st.sets(st.integers(0, 40), max_size=6),
    back=st.sets(st.integers(0, 40), max_size=6),
)
def test_a_segmented_download_arrives_once_despite_losses(out: set[int], back: set[int]) -> None:
    data = bytes(i & 0xFF for i in range(700))
    dictionary = Dictionary({})
    device = MailboxDevice(dictionary)
    device.lose_out, device.lose_back = out, back - out
    try:
        play(download(channel(), 0x2000, 1, data), device)
    except ResponseTimeout:
        longest = _longest_run(out | back)
        assert longest >= 5  # only if the tolerated number of frames in a row was lost
        return
    assert dictionary.written == [(0x2000, 1, data)]


def test_a_device_that_never_answers_times_out() -> None:
    with pytest.raises(ResponseTimeout, match=r"device 3 \(Probe\): no answer"):
        play(upload(channel(), 0x2000, 0), MailboxDevice(lambda _: []))


def test_a_device_that_does_not_read_its_mailbox_times_out() -> None:
    device = MailboxDevice(lambda _: [])
    device.deaf = True
    mailbox = channel()
    with pytest.raises(ResponseTimeout):
        play(upload(mailbox, 0x2000, 0), device)
    with pytest.raises(MailboxError, match="has not read its mailbox"):
        play(upload(mailbox, 0x2000, 0), device)


def test_counters_cycle_from_1_to_7() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    mailbox = channel()
    for _ in range(9):
        play(upload(mailbox, 0x2000, 0), device)
    assert [message.counter for message in device.received] == [1, 2, 3, 4, 5, 6, 7, 1, 2]


def test_drain_empties_the_mailbox() -> None:
    device = MailboxDevice(lambda _: [])
    answers = Dictionary(OBJECT)
    for message in (_request(), _request()):
        for answer in answers(message):
            device.send(answer)
    assert len(play(drain(channel(), lambda message: message), device)) == 2


def _request() -> Mailbox:
    return Mailbox(Type.COE, UploadRequest(0x2000, 0).encode())


def _longest_run(numbers: set[int]) -> int:
    longest = run = 0
    for number in range(max(numbers, default=0) + 1):
        run = run + 1 if number in numbers else 0
        longest = max(longest, run)
    return longest


def test_a_lost_poll_that_left_the_message_needs_no_repetition() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    device.repeats = False
    mailbox = channel()
    play(upload(mailbox, 0x2000, 0), device)
    device.lose_out = {3}  # the poll of the second upload: 0 to 2 are write, read, write
    assert play(upload(mailbox, 0x2000, 0), device) == OBJECT[0x2000, 0]
    assert device.repeat_requests == 0


def test_a_lost_poll_that_took_the_message_is_repeated() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    mailbox = channel()
    play(upload(mailbox, 0x2000, 0), device)
    device.lose_back = {3}
    assert play(upload(mailbox, 0x2000, 0), device) == OBJECT[0x2000, 0]
    assert device.repeat_requests == 1
    assert len(device.received) == 2


# Violations of the protocol by devices


def test_a_device_that_answers_twice_stays_in_step() -> None:
    values = iter(range(100))

    def twice(message: Mailbox) -> list[Mailbox]:
        answer = Dictionary({(0x2000, 0): bytes([next(values)])})(message)
        return [*answer, *answer]

    mailbox = channel()
    device = MailboxDevice(twice)
    assert [play(upload(mailbox, 0x2000, 0), device) for _ in range(5)] == [
        bytes([k]) for k in range(5)
    ]
    assert mailbox.dropped == 4


def test_an_answer_of_another_kind_is_dropped_and_reported() -> None:
    device = MailboxDevice(lambda _: [Mailbox(Type.EOE, bytes(20))])
    mailbox = channel()
    with pytest.raises(ResponseTimeout, match="1 other messages arrived"):
        play(upload(mailbox, 0x2000, 0), device)
    assert mailbox.dropped == 1


def test_endless_unexpected_messages_are_an_error() -> None:
    device = MailboxDevice(lambda _: [Mailbox(Type.EOE, bytes(20))] * 500)
    with pytest.raises(MailboxError, match="64 unexpected mailbox messages in a row"):
        play(upload(channel(), 0x2000, 0), device)


def test_draining_endless_messages_ends() -> None:
    device = MailboxDevice(lambda _: [])
    for _ in range(500):
        device.send(Mailbox(Type.EOE, bytes(20)))
    assert len(play(drain(channel(), lambda message: message), device)) < 100


@pytest.mark.parametrize(
    "counters", [[0, 0, 0, 0], [5, 1, 7, 2], [3, 3, 3, 3], [1, 1, 2, 2], [7, 7, 7, 1]]
)
def test_constant_or_jumping_counters_are_accepted(counters: list[int]) -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    given = iter(counters)
    device.next_counter = lambda: next(given)
    mailbox = channel()
    for _ in counters:
        assert play(upload(mailbox, 0x2000, 0), device) == OBJECT[0x2000, 0]
    assert mailbox.dropped == 0


@pytest.mark.parametrize("counter", [0, 1, None])
@settings(max_examples=100, deadline=None)
@given(
    out=st.sets(st.integers(0, 40), max_size=3),
    back=st.sets(st.integers(0, 40), max_size=3),
)
def test_segments_are_joined_despite_losses_with_any_counter(
    counter: int | None, out: set[int], back: set[int]
) -> None:
    """Counters of 0, always 1, or as in the standard. Segments differ in their toggle bit."""
    data = bytes(i & 0xFF for i in range(700))
    device = MailboxDevice(Dictionary({(0x2000, 1): data}))
    if counter is not None:
        device.next_counter = lambda: counter
    device.repeats_first = True
    device.lose_out, device.lose_back = out, back - out
    assert play(upload(channel(), 0x2000, 1), device) == data


def test_a_repetition_of_an_accepted_message_is_dropped() -> None:
    """The read request is lost: the device repeats the previous answer, then sends the new
    one."""
    values = iter([b"\x01", b"\x01", b"\x02"])
    device = MailboxDevice(lambda message: Dictionary({(0x2000, 0): next(values)})(message))
    device.next_counter = lambda: (
        0
    )  # check the status first, so that a lost read is repeated at once
    device.repeats_first = True
    mailbox = channel()
    assert [play(upload(mailbox, 0x2000, 0), device) for _ in range(2)] == [b"\x01"] * 2
    assert mailbox.dropped == 0
    device.lose_out = {5}  # 0 to 3 are two writes and reads, 4 is the third write
    assert play(upload(mailbox, 0x2000, 0), device) == b"\x02"
    assert mailbox.dropped == 1


@pytest.mark.parametrize("counter", [0, 1])
def test_repetitions_do_not_hide_the_next_answer(counter: int) -> None:
    """Two reads of one answer are lost, so two repetitions are requested and one arrives. Equal
    answers to the next requests are not repetitions."""
    device = MailboxDevice(lambda message: Dictionary({(0x2000, 0): values.pop(0)})(message))
    values = [b"\x01", b"\x02", b"\x02", b"\x02"]
    device.next_counter = lambda: counter
    mailbox = channel()
    assert play(upload(mailbox, 0x2000, 0), device) == b"\x01"
    device.lose_back = {3, 4}  # 0 and 1 are the first write and read
    assert [play(upload(mailbox, 0x2000, 0), device) for _ in range(3)] == [b"\x02"] * 3


def test_a_device_that_cannot_repeat_answers_the_next_request() -> None:
    """Both the read and the answer are lost. The next answer equals the last accepted one."""
    device = MailboxDevice(Dictionary(OBJECT))
    device.next_counter = lambda: 1
    device.repeats = False
    mailbox = channel()
    assert [play(upload(mailbox, 0x2000, 0), device) for _ in range(2)] == [OBJECT[0x2000, 0]] * 2
    device.lose_back = {5}
    with pytest.raises(MailboxError, match="does not acknowledge the repeat request"):
        play(upload(mailbox, 0x2000, 0), device)
    assert play(upload(mailbox, 0x2000, 0), device) == OBJECT[0x2000, 0]


def test_a_length_beyond_the_mailbox_is_a_mailbox_error() -> None:
    device = MailboxDevice(Dictionary(OBJECT))
    device.spoil = lambda data: (60000).to_bytes(2, "little") + data[2:]
    with pytest.raises(MailboxError, match=r"device 3 \(Probe\): invalid mailbox message"):
        play(upload(channel(), 0x2000, 0), device)


def test_a_late_answer_is_not_taken_for_the_next_one() -> None:
    mailbox = channel()
    answers = Dictionary({(0x2000, 0): b"\x01"})
    device = MailboxDevice(lambda _: [])
    with pytest.raises(ResponseTimeout):
        play(upload(mailbox, 0x2000, 0), device)
    for answer in answers(device.received[-1]):
        device.send(answer)  # after the deadline
    device.respond = Dictionary({(0x2000, 0): b"\x02"})
    assert play(upload(mailbox, 0x2000, 0), device) == b"\x02"


def test_the_answer_to_an_abandoned_request_is_dropped() -> None:
    mailbox = channel()
    device = MailboxDevice(Dictionary({(0x2000, 0): b"\x01"}))
    abandoned = upload(mailbox, 0x2000, 0)
    device(next(abandoned)[1])  # type: ignore[index]
    abandoned.close()  # Ctrl-C
    device.respond = Dictionary({(0x2000, 0): b"\x02"})
    assert play(upload(mailbox, 0x2000, 0), device) == b"\x02"


def test_conversations_run_in_the_order_of_their_start() -> None:
    mailbox = channel()
    device = MailboxDevice(Dictionary(OBJECT))
    first, second = upload(mailbox, 0x2000, 0), upload(mailbox, 0x2000, 0)
    next(first)
    next(second)
    third = upload(mailbox, 0x2000, 0)
    first.close()
    assert isinstance(next(third), After)  # the second one's turn
    assert play_on(second, device) == OBJECT[0x2000, 0]
    assert play_on(third, device) == OBJECT[0x2000, 0]


def play_on(procedure: Procedure[bytes], device: MailboxDevice) -> bytes:
    """Continue a procedure after a pause."""

    def rest() -> Procedure[bytes]:
        replies: list[Reply] = []
        while True:
            try:
                step = procedure.send(replies)
            except StopIteration as stop:
                return stop.value
            replies = yield step

    return play(rest(), device)


def test_the_first_poll_adapts_to_the_answer_time() -> None:
    """The device takes 20 ms: the first answers are polled often, later ones only a few times."""
    mailbox = channel()
    polls: list[int] = []
    answers = Dictionary(OBJECT)
    device = MailboxDevice(lambda _: [])
    now = [0]
    due: list[int] = []

    def answer(request: Request) -> Reply:
        if request.address >> 16 == 0x080D and len(request.data) == 1:
            polls[-1] += 1
            if due and now[0] >= due[0]:
                due.clear()
                for message in answers(device.received[-1]):
                    device.send(message)
        count = len(device.received)
        reply = device(request)
        if len(device.received) > count:
            due.append(now[0] + 20_000_000)
        return reply

    for _ in range(20):
        polls.append(0)
        assert play_timed(upload(mailbox, 0x2000, 0), answer, now) == OBJECT[0x2000, 0]
    assert polls[0] > 8
    assert max(polls[10:]) <= 5


def play_timed(
    procedure: Procedure[bytes], answer: Callable[[Request], Reply], now: list[int]
) -> bytes:
    step = next(procedure)
    while True:
        if isinstance(step, After):
            now[0] += round(step.seconds * 1e9)
            replies = []
        else:
            now[0] += 100_000
            replies = [answer(request)._replace(time_ns=now[0]) for request in step]
        try:
            step = procedure.send(replies)
        except StopIteration as stop:
            return stop.value
