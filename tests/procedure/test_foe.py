"""File transfers with a simulated server: sizes, BUSY, refusals, violations of the protocol."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.errors import FoeError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import Procedure, Reply, Request, Step
from catenary.procedure.foe import OVERHEAD, read, write
from catenary.procedure.foe_exchange import Patience, Progress
from catenary.wire.foe import (
    Acknowledge,
    Busy,
    Data,
    Error,
    ErrorCode,
    Message,
    ReadRequest,
    WriteRequest,
    decode_foe,
)
from catenary.wire.mailbox import ErrorReply, Mailbox, Type
from tests.procedure.player import LAYOUT, MailboxDevice, channel, play
from tests.wire.strategies import u32

ROOM = LAYOUT.send_size - OVERHEAD
SIZES = [0, 1, ROOM - 1, ROOM, ROOM + 1, 2 * ROOM, 10 * ROOM + 7]


class Server:
    """Owner of files. It answers FoE requests as the state machines of ETG.1000.6 §5.8.8 do."""

    def __init__(self, files: dict[str, bytes] | None = None) -> None:
        self.files = dict(files or {})
        self.received: list[Message] = []
        self._name = ""
        self._written = bytearray()
        self._packet = 0
        self._rest: list[bytes] = []

    def __call__(self, message: Mailbox) -> list[Mailbox]:
        request = decode_foe(message.data)
        self.received.append(request)
        return [Mailbox(Type.FOE, answer.encode()) for answer in self.answer(request)]

    def answer(self, request: Message) -> list[Message]:
        match request:
            case WriteRequest(name):
                self._name, self._packet = name, 0
                self._written.clear()
                return [Acknowledge(0)]
            case Data(packet, data):
                self._packet += 1
                if packet != self._packet:
                    return [Error(ErrorCode.PACKET_NUMBER)]
                self._written += data
                if len(data) < ROOM:
                    self.files[self._name] = bytes(self._written)
                return [Acknowledge(packet)]
            case ReadRequest(name) if name not in self.files:
                return [Error(ErrorCode.NOT_FOUND, "no such file")]
            case ReadRequest(name):
                content, self._packet = self.files[name], 0
                self._rest = [content[k : k + ROOM] for k in range(0, len(content) + 1, ROOM)]
                return self._next()
            case Acknowledge(packet):
                return self._next() if packet == self._packet else [Error(ErrorCode.PACKET_NUMBER)]
        return []

    def _next(self) -> list[Message]:
        self._packet += 1
        return [Data(self._packet, self._rest.pop(0))] if self._rest else []


class BusyServer(Server):
    """Server that answers BUSY `times` times before it accepts each message.

    With `continued`, acknowledgement 0 continues a busy read, as in the SSC since version 5.11.
    """

    def __init__(
        self, times: int, files: dict[str, bytes] | None = None, *, continued: bool = True
    ) -> None:
        super().__init__(files)
        self._times = self._left = times
        self._continued = continued
        self._reading: ReadRequest | None = None

    def answer(self, request: Message) -> list[Message]:
        if self._continued and isinstance(request, ReadRequest):
            if self._reading is not None:
                self._reading = None
                return [Error(ErrorCode.ILLEGAL)]
            self._reading = request
        elif request == Acknowledge(0) and self._reading is None:
            return [Error(ErrorCode.ILLEGAL)]
        if self._left:
            self._left -= 1
            return [Busy(self._times - self._left, self._times, "erase")]
        self._left = self._times
        if request == Acknowledge(0) and self._reading is not None:
            request = self._reading
        return super().answer(request)


def content(size: int) -> bytes:
    return bytes(k * 7 & 0xFF for k in range(size))


@pytest.mark.parametrize("size", SIZES)
def test_files_of_all_sizes_are_written(size: int) -> None:
    server, progress = Server(), Progress()
    play(write(channel(), "a", content(size), progress=progress), MailboxDevice(server))
    assert server.files == {"a": content(size)}
    assert (progress.done, progress.total) == (size, size)
    packets = [each for each in server.received if isinstance(each, Data)]
    assert [each.packet for each in packets] == list(range(1, size // ROOM + 2))
    assert len(packets[-1].data) == size % ROOM  # empty if the size is a multiple


@pytest.mark.parametrize("size", SIZES)
def test_files_of_all_sizes_are_read(size: int) -> None:
    server, progress = Server({"a": content(size)}), Progress()
    assert play(read(channel(), "a", progress=progress), MailboxDevice(server)) == content(size)
    assert (progress.done, progress.total) == (size, None)
    assert server.received[-1] == Acknowledge(size // ROOM + 1)


def test_name_and_password_are_sent() -> None:
    server = Server({"b": b""})
    play(write(channel(), "a", b"", password=0x1234), MailboxDevice(server))
    play(read(channel(), "b", password=0xFFFF_FFFF), MailboxDevice(server))
    assert server.received[0] == WriteRequest("a", 0x1234)
    assert ReadRequest("b", 0xFFFF_FFFF) in server.received


@pytest.mark.parametrize(("name", "password"), [("", 0), ("x" * (ROOM + 1), 0), ("a", 1 << 32)])
def test_a_name_or_password_that_does_not_fit_is_refused_before_anything_is_sent(
    name: str, password: int
) -> None:
    with pytest.raises(ValueError, match=r"FoE|file name"):
        write(channel(), name, b"", password=password)
    with pytest.raises(ValueError, match=r"FoE|file name"):
        read(channel(), name, password=password)


def test_a_refusal_has_code_text_and_hint() -> None:
    with pytest.raises(FoeError, match=r"Probe.*'a' refused with 0x8001: file not found \(no such"):
        play(read(channel(), "a"), MailboxDevice(Server()))
    device = MailboxDevice(Server())
    with pytest.raises(FoeError) as caught:
        play(read(channel(), "a"), device)
    error = caught.value
    assert (error.position, error.name, error.code, error.text) == (3, "a", 0x8001, "no such file")
    assert "manual" in error.hint


def test_a_refusal_in_the_middle_states_the_place() -> None:
    class Full(Server):
        def answer(self, request: Message) -> list[Message]:
            if isinstance(request, Data) and request.packet == 3:
                return [Error(ErrorCode.DISK_FULL)]
            return super().answer(request)

    with pytest.raises(FoeError, match=rf"refused after {2 * ROOM} bytes with 0x8003: disk full"):
        play(write(channel(), "a", content(5 * ROOM)), MailboxDevice(Full()))


@pytest.mark.parametrize("times", [1, 3])
def test_after_busy_the_same_message_is_sent_again(times: int) -> None:
    server, progress = BusyServer(times), Progress()
    play(write(channel(), "a", content(ROOM), progress=progress), MailboxDevice(server))
    assert server.files == {"a": content(ROOM)}
    assert server.received[: times + 1] == [WriteRequest("a")] * (times + 1)
    assert progress.busy is None
    reader = BusyServer(times, {"a": content(2 * ROOM)})
    assert play(read(channel(), "a"), MailboxDevice(reader)) == content(2 * ROOM)
    assert reader.received.count(Acknowledge(1)) == times + 1


def test_a_busy_read_request_is_continued_with_acknowledgement_0() -> None:
    server = BusyServer(2, {"a": b"abc"})
    assert play(read(channel(), "a"), MailboxDevice(server)) == b"abc"
    assert server.received == [
        ReadRequest("a"),
        Acknowledge(0),
        Acknowledge(0),
        Acknowledge(1),
    ]


def test_a_stack_that_expects_the_read_request_again_after_busy() -> None:
    server = BusyServer(3, {"a": b"abc"}, continued=False)
    assert play(read(channel(), "a"), MailboxDevice(server)) == b"abc"


@pytest.mark.parametrize("writes", [True, False])
def test_a_request_after_an_interrupted_transfer_is_sent_again(writes: bool) -> None:
    class Interrupted(Server):
        """Server with an unfinished transfer, which the next request ends (SSC, SOES)."""

        unfinished = True

        def answer(self, request: Message) -> list[Message]:
            if self.unfinished:
                self.unfinished = False
                return [Error(ErrorCode.ILLEGAL)]
            return super().answer(request)

    server = Interrupted({"a": b"abc"})
    if writes:
        play(write(channel(), "a", b"new"), MailboxDevice(server))
        assert server.files == {"a": b"new"}
    else:
        assert play(read(channel(), "a"), MailboxDevice(server)) == b"abc"


@pytest.mark.parametrize("writes", [True, False])
def test_a_request_that_stays_illegal_is_refused(writes: bool) -> None:
    server = MailboxDevice(lambda _: [Mailbox(Type.FOE, Error(ErrorCode.ILLEGAL).encode())])
    procedure = write(channel(), "a", b"") if writes else read(channel(), "a")
    with pytest.raises(FoeError, match="0x8004"):
        play(procedure, server)
    assert len(server.received) <= 3


class LateDevice(MailboxDevice):
    """Device that answers our error message later, with an error of its own, as the SSC may do."""

    def __init__(self, respond: Callable[[Mailbox], list[Mailbox]]) -> None:
        super().__init__(respond)
        self._requests_left: int | None = None

    def __call__(self, request: Request) -> Reply:
        ended = self.received and decode_foe(self.received[-1].data) == Error(
            ErrorCode.PACKET_NUMBER
        )
        if ended and self._requests_left is None:
            self._requests_left = 4
        elif self._requests_left:
            self._requests_left -= 1
            if not self._requests_left:
                self.send(Mailbox(Type.FOE, Error(ErrorCode.NOT_DEFINED).encode()))
        return super().__call__(request)


def test_a_late_answer_to_our_error_message_is_dropped() -> None:
    class Wrong(Server):
        def answer(self, request: Message) -> list[Message]:
            wrong = request == ReadRequest("wrong")
            return [Data(9, b"")] if wrong else super().answer(request)

    device, mailbox = LateDevice(Wrong({"a": b"abc"})), channel()
    with pytest.raises(MailboxError, match="packet number 9"):
        play(read(mailbox, "wrong"), device)
    assert play(read(mailbox, "a"), device) == b"abc"
    assert mailbox.dropped == 1


def test_a_device_that_stays_busy_is_given_up() -> None:
    server = BusyServer(60_000)
    patience = Patience(answer=1.0, busy=5.0)
    with pytest.raises(ResponseTimeout, match=r"busy for 5 s after 0 bytes.*erase"):
        play(write(channel(), "a", b"", patience=patience), MailboxDevice(server))
    assert server.received[-1] == Error(ErrorCode.NOT_DEFINED)


def test_the_time_of_a_busy_device_starts_again_with_each_packet() -> None:
    server = BusyServer(40)  # about 2 s for each packet
    patience = Patience(answer=1.0, busy=3.0)
    play(write(channel(), "a", content(5 * ROOM), patience=patience), MailboxDevice(server))
    assert server.files == {"a": content(5 * ROOM)}


def test_a_device_that_does_not_answer_times_out() -> None:
    with pytest.raises(ResponseTimeout, match=r"no answer to a FOE message within 3 s"):
        play(
            write(channel(), "a", b"", patience=Patience(answer=3.0)),
            MailboxDevice(lambda _: []),
        )


def test_duplicates_are_dropped() -> None:
    class Twice(Server):
        """Server that sends its previous answer once more before each answer."""

        def __init__(self, files: dict[str, bytes] | None = None) -> None:
            super().__init__(files)
            self._last: list[Message] = []

        def answer(self, request: Message) -> list[Message]:
            again, self._last = self._last, super().answer(request)
            return [*again, *self._last]

    written = Twice()
    play(write(channel(), "a", content(3 * ROOM)), MailboxDevice(written))
    assert written.files == {"a": content(3 * ROOM)}
    mailbox = channel()
    reader = MailboxDevice(Twice({"a": content(3 * ROOM + 1)}))
    assert play(read(mailbox, "a"), reader) == content(3 * ROOM + 1)
    assert mailbox.dropped >= 3


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (Acknowledge(7), "packet number 7 instead of 2"),
        (Acknowledge(0), "packet number 0 instead of 2"),
        (Data(2, b""), "Data instead of Acknowledge 2"),
    ],
)
def test_a_wrong_answer_ends_a_write_with_an_error_message(answer: Message, said: str) -> None:
    class Wrong(Server):
        def answer(self, request: Message) -> list[Message]:
            answers = super().answer(request)
            return [answer] if isinstance(request, Data) and request.packet == 2 else answers

    server = Wrong()
    with pytest.raises(MailboxError, match=rf"Probe.*'a': the device sent {said}, after {ROOM}"):
        play(write(channel(), "a", content(5 * ROOM)), MailboxDevice(server))
    assert isinstance(server.received[-1], Error)


def test_reordered_packets_end_a_read_with_an_error_message() -> None:
    class Reordered(Server):
        def answer(self, request: Message) -> list[Message]:
            if request == Acknowledge(1):
                return [Data(3, bytes(ROOM)), Data(2, bytes(ROOM))]
            return super().answer(request)

    server = Reordered({"a": content(5 * ROOM)})
    with pytest.raises(MailboxError, match="packet number 3 instead of 2"):
        play(read(channel(), "a"), MailboxDevice(server))
    assert server.received[-1] == Error(ErrorCode.PACKET_NUMBER)


def test_a_stopped_transfer_ends_with_an_error_message() -> None:
    progress = Progress()

    class Stopping(Server):
        def answer(self, request: Message) -> list[Message]:
            progress.stopped = request == Data(2, content(5 * ROOM)[ROOM : 2 * ROOM])
            return super().answer(request)

    server = Stopping()
    with pytest.raises(MailboxError, match=f"stopped after {2 * ROOM} bytes"):
        play(write(channel(), "a", content(5 * ROOM), progress=progress), MailboxDevice(server))
    assert server.received[-1] == Error(ErrorCode.NOT_DEFINED)


def test_an_endless_file_ends_at_the_limit() -> None:
    class Endless(Server):
        def answer(self, request: Message) -> list[Message]:
            match request:
                case ReadRequest():
                    return [Data(1, bytes(ROOM))]
                case Acknowledge(packet):
                    return [Data(packet + 1, bytes(ROOM))]
            return []

    server = Endless()
    with pytest.raises(MailboxError, match=f"larger than {10 * ROOM} bytes"):
        play(read(channel(), "a", max_size=10 * ROOM), MailboxDevice(server))
    assert server.received[-1] == Error(ErrorCode.DISK_FULL)
    assert len(server.received) == 12


def test_a_file_of_the_limit_is_read() -> None:
    server = MailboxDevice(Server({"a": content(2 * ROOM)}))
    assert play(read(channel(), "a", max_size=2 * ROOM), server) == content(2 * ROOM)


@pytest.mark.parametrize("data", [b"", b"\x04\x00\x00", b"\x09\x00\x00\x00\x00\x00"])
def test_an_invalid_message_is_an_error_of_the_device(data: bytes) -> None:
    device = MailboxDevice(lambda _: [Mailbox(Type.FOE, data)])
    with pytest.raises(MailboxError, match=r"Probe\): invalid FoE message"):
        play(write(channel(), "a", b""), device)


def test_a_device_without_foe_answers_with_a_mailbox_error() -> None:
    device = MailboxDevice(lambda _: [Mailbox(Type.ERROR, ErrorReply(2).encode())])
    with pytest.raises(MailboxError, match="protocol is not supported"):
        play(read(channel(), "a"), device)


def test_a_late_answer_of_the_last_transfer_is_dropped() -> None:
    server = Server()
    device = MailboxDevice(server)
    device.send(Mailbox(Type.FOE, Error(ErrorCode.FLASH).encode()))
    mailbox = channel()
    play(write(mailbox, "a", b"abc"), device)
    assert server.files == {"a": b"abc"}
    assert mailbox.dropped == 1


arbitrary = st.one_of(
    st.binary(max_size=20),
    st.builds(
        lambda packet, size: Data(packet, bytes(size)).encode(), u32, st.sampled_from(SIZES[:4])
    ),
    st.builds(lambda packet: Acknowledge(packet).encode(), st.integers(0, 3)),
    st.builds(lambda code: Error(code).encode(), u32),
    st.just(Busy(1, 2).encode()),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(Type), arbitrary), max_size=12), st.booleans())
def test_arbitrary_answers_end_with_a_result_or_a_specific_error(
    answers: list[tuple[Type, bytes]], writes: bool
) -> None:
    left = iter(answers)
    device = MailboxDevice(lambda _: [Mailbox(*each) for each in [next(left, None)] if each])
    patience = Patience(answer=1.0, busy=2.0)
    try:
        if writes:
            play(write(channel(), "a", content(2 * ROOM), patience=patience), device)
        else:
            assert len(play(read(channel(), "a", max_size=1000, patience=patience), device)) <= 1000
    except (FoeError, MailboxError, ResponseTimeout):
        return


@settings(max_examples=100, deadline=None)
@given(
    out=st.sets(st.integers(0, 40), max_size=6),
    back=st.sets(st.integers(0, 40), max_size=6),
)
def test_a_file_arrives_despite_lost_frames(out: set[int], back: set[int]) -> None:
    server = Server()
    device = MailboxDevice(server)
    device.lose_out, device.lose_back = out, back - out
    mailbox = channel()  # it knows the toggle bit of the device
    try:
        play(write(mailbox, "a", content(5 * ROOM)), device)
        assert play(read(mailbox, "a"), device) == content(5 * ROOM)
    except ResponseTimeout:
        assert len(out | back) >= 5  # the number of frames in a row that may be lost
        return
    assert server.files == {"a": content(5 * ROOM)}


def test_a_lost_last_acknowledgement_is_sent_again() -> None:
    server = Server({"a": b"abc"})
    device = MailboxDevice(server)
    device.lose_out = {2, 3}  # 0 is the request, 1 its answer
    assert play(read(channel(), "a"), device) == b"abc"
    assert server.received == [ReadRequest("a"), Acknowledge(1)]


def counted(procedure: Procedure[bytes], steps: list[Step]) -> Procedure[bytes]:
    """Run a procedure, and add its exchanges to `steps`."""
    try:
        step = next(procedure)
        while True:
            if isinstance(step, list):
                steps.append(step)
            step = procedure.send((yield step))
    except StopIteration as stop:
        return bytes(stop.value)


@pytest.mark.parametrize("eager_max", [LAYOUT.send_size, LAYOUT.send_size - 1])
def test_a_packet_takes_two_exchanges_if_the_device_is_punctual(
    eager_max: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("catenary.procedure.mailbox.EAGER_MAX", eager_max)
    steps: list[Step] = []
    device = MailboxDevice(Server({"a": content(60 * ROOM)}))
    assert play(counted(read(channel(), "a"), steps), device) == content(60 * ROOM)
    assert len(steps) <= 2 * 61 + 5
