"""While the drives move, one device answers twice, wrongly, endlessly or late.
The request fails in time with a specific error. The next request gets its own answer.
The cycle, the other devices and the stop at the end are not affected.
"""

import struct
from collections.abc import Callable, Iterable
from random import Random

import pytest

import catenary as cat
from catenary.bus import Pending
from catenary.errors import CatenaryError, MailboxError, ResponseTimeout
from catenary.link import Fault
from catenary.types import UDINT, UINT
from catenary.virtual import Servo
from catenary.virtual.faults import late_mailbox, mailbox_silent
from tests.scenario.cell import Cell

COE, EOE, SDO_RESPONSE = 3, 2, 3
SERIAL, LARGE, SCRATCH = (0x1018, 4), 0x2100, 0x2102

Answers = list[tuple[int, bytes]]  # protocol of the mailbox, its data
Misdeed = Callable[[bytes, Answers], Answers]  # (request, correct answers) to sent answers


def twice(_request: bytes, right: Answers) -> Answers:
    return [*right, *right]


def of_another_protocol(_request: bytes, right: Answers) -> Answers:
    return [(EOE, data) for _, data in right]


def nothing(_request: bytes, _right: Answers) -> Answers:
    return []


def cut_short(_request: bytes, right: Answers) -> Answers:
    return [(protocol, data[:5]) for protocol, data in right]


def about_something_else(_request: bytes, right: Answers) -> Answers:
    return [(COE, data[:3] + b"\x34\x12" + data[5:]) for _, data in right]


def noise(_request: bytes, right: Answers) -> Answers:
    return [(COE, Random(len(right)).randbytes(60)) for _ in right]


def without_end(request: bytes, _right: Answers) -> Answers:
    """Announce 4 GiB, then send segments without end."""
    command = request[8]
    if command >> 5 == 3:
        return [(COE, struct.pack("<HB", SDO_RESPONSE << 12, command & 0x10) + bytes(100))]
    index, subindex = struct.unpack_from("<HB", request, 9)
    head = struct.pack("<HBHBI", SDO_RESPONSE << 12, 0x41, index, subindex, 0xFFFF_FFFF)
    return [(COE, head + bytes(100))]


def drip(request: bytes, right: Answers) -> Answers:
    """Announce a valid size, then send single bytes beyond that size."""
    command = request[8]
    if command >> 5 == 3:
        # 6 of the 7 bytes are none
        return [(COE, struct.pack("<HB", SDO_RESPONSE << 12, command & 0x10 | 6 << 1) + bytes(7))]
    index, subindex = struct.unpack_from("<HB", request, 9)
    return [(COE, struct.pack("<HBHBI", SDO_RESPONSE << 12, 0x41, index, subindex, 50))]


MISDEEDS: list[tuple[Misdeed, type[CatenaryError] | None, str]] = [
    (twice, None, ""),
    (of_another_protocol, ResponseTimeout, "other messages arrived"),
    (nothing, ResponseTimeout, "no answer to a COE message within 2 s"),
    (cut_short, MailboxError, "invalid CoE message"),
    (about_something_else, ResponseTimeout, "other messages arrived"),
    (noise, CatenaryError, "device 2"),
    (without_end, MailboxError, "announces 4294967295 bytes, the limit is"),
    (drip, MailboxError, "violates the protocol"),
]


def misbehave(servo: Servo, misdeed: Misdeed | None) -> None:
    """Replace the answers of a device until the replacement is None."""
    mailbox = servo.application.mailbox
    if "_answers" in vars(mailbox):
        del mailbox._answers  # type: ignore[method-assign]
    if misdeed is None:
        return
    right = mailbox._answers

    def answers(request: bytes) -> Iterable[tuple[int, bytes]]:
        return misdeed(request, list(right(request)))

    mailbox._answers = answers  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("misdeed", "error", "words"), MISDEEDS, ids=[misdeed.__name__ for misdeed, *_ in MISDEEDS]
)
def test_only_the_request_fails(
    cell: Cell, misdeed: Misdeed, error: type[CatenaryError] | None, words: str
) -> None:
    bad, good = cell.subs.drives
    arm = cell.drives()
    answers: list[Pending[int]] = []
    others = 0
    with cat.Loop(arm) as loop:
        other = good.sdo.request(*SERIAL, type=UDINT)
        misbehave(cell.servos[0], misdeed)
        answers.append(bad.sdo.request(*SERIAL, type=UDINT))
        for cycle in loop:
            if other.done:
                assert other.result() == 2
                others += 1
                other = good.sdo.request(*SERIAL, type=UDINT)
            if len(answers) == 1 and answers[0].done:
                misbehave(cell.servos[0], None)
                answers += [bad.sdo.request(*SERIAL, type=UDINT) for _ in range(3)]
            if all(answer.done for answer in answers):
                break
            assert cycle.number < 4000
        assert loop.timing.counters["lost"] == 0
        assert loop.timing.counters["late"] == 0
        assert others > cycle.number / 5
    if error is None:
        assert answers[0].result() == 1
    else:
        with pytest.raises(error, match=words):
            answers[0].result()
        assert "device 2" in str(answers[0].error)
    assert [answer.result() for answer in answers[1:]] == [1, 1, 1]
    cell.assert_safe()


def test_a_short_silence_of_a_mailbox_is_tolerated(cell: Cell) -> None:
    drive, _ = cell.subs.drives
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        cell.segment.inject(mailbox_silent(drive.position, for_=0.5))
        answer = drive.sdo.request(*SERIAL, type=UDINT)
        for cycle in loop:
            if answer.done:
                break
            assert cycle.number < 700
        assert cycle.number >= 500
        assert loop.timing.counters["lost"] == 0
    assert answer.result() == 1


def test_a_long_silence_of_a_mailbox_is_an_error_and_the_mailbox_recovers(cell: Cell) -> None:
    drive, _ = cell.subs.drives
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        cell.segment.inject(mailbox_silent(drive.position, for_=4.0))
        answers = [drive.sdo.request(*SERIAL, type=UDINT) for _ in range(2)]
        for cycle in loop:
            if cycle.number == 4200:
                later = drive.sdo.request(*SERIAL, type=UDINT)
            if cycle.number == 4500:
                break
        assert loop.timing.counters["lost"] == 0
    for answer in answers:
        assert isinstance(answer.error, ResponseTimeout | MailboxError)
        assert "device 2" in str(answer.error)
    assert later.result() == 1
    cell.assert_safe()


def test_a_slow_answer_is_accepted(cell: Cell) -> None:
    drive, _ = cell.subs.drives
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        cell.segment.inject(late_mailbox(drive.position, by=0.3))
        sent = loop.timing.counters["acyclic_sent"]
        answers = [drive.sdo.request(*SERIAL, type=UDINT) for _ in range(4)]
        for cycle in loop:
            if all(answer.done for answer in answers):
                break
            assert cycle.number < 2000
        assert loop.timing.counters["acyclic_sent"] - sent < 500
    assert [answer.result() for answer in answers] == [1, 1, 1, 1]


@pytest.mark.parametrize("seed", range(4))
def test_all_answers_are_correct_although_frames_are_lost(cell: Cell, seed: int) -> None:
    """A fifth of the acyclic frames is lost, half of them on the way out."""
    drive, _ = cell.subs.drives
    arm = cell.drives()
    for direction in ("sent", "received"):
        cell.link.inject(
            Fault(kind="lose", direction=direction, traffic="acyclic", probability=0.1)  # type: ignore[arg-type]
        )
    random = Random(seed)
    with cat.Loop(arm) as loop:
        asked: list[tuple[str, int, Pending[int] | Pending[None] | Pending[bytes]]] = []
        written = drive.sdo.request_write(SCRATCH, 0, 0, type=UINT)
        asked.append(("write", 0, written))
        value = 0
        for _ in range(40):
            match random.randrange(3):
                case 0:
                    value = random.randrange(0xFFFF)
                    asked.append(
                        ("write", value, drive.sdo.request_write(SCRATCH, 0, value, type=UINT))
                    )
                case 1:
                    asked.append(("read", value, drive.sdo.request(SCRATCH, type=UINT)))
                case _:
                    asked.append(("large", 0, drive.sdo.request(LARGE)))
        for cycle in loop:
            if all(answer.done for _, _, answer in asked):
                break
            assert cycle.number < 60_000
        assert loop.timing.counters["lost"] == 0
        assert loop._opened.service.runner.counts.lost > 10
    large = bytes(k * 7 & 0xFF for k in range(2048))
    for kind, expected, answer in asked:
        if kind == "read":
            assert answer.result() == expected
        elif kind == "large":
            assert answer.result() == large
        else:
            assert answer.result() is None
    cell.assert_safe()
