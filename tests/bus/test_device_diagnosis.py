"""Diagnosis history and synchronisation counters of virtual devices."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import DecodeError, MailboxError, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.types import BOOL, UINT, ULINT, USINT
from catenary.virtual import Coupler, HistoryOptions, Segment, Servo
from catenary.virtual.coe.diagnosis_history import FAULT, REFUSED, TEXTS
from tests.esi import servo_file

GROWING = HistoryOptions(messages=4, message_bytes=0)
FIXED = HistoryOptions(messages=4, message_bytes=32)
ACKNOWLEDGE_MODE = 0x10


def with_texts(texts: dict[int, str]) -> str:
    messages = "".join(
        f"<DiagMessage><TextId>#x{number:X}</TextId>"
        f'<MessageText LcId="1033">{text}</MessageText></DiagMessage>'
        for number, text in texts.items()
    )
    diagnosis = f"<DiagMessages>{messages}</DiagMessages></Profile>"
    return servo_file.PROFILE.replace("</Profile>", diagnosis)


@pytest.fixture(params=[GROWING, FIXED], ids=["growing", "fixed"])
def servo(request: pytest.FixtureRequest) -> Servo:
    return Servo(diagnosis=request.param)


@pytest.fixture
def sub(servo: Servo) -> Iterator[cat.SubDevice]:
    with cat.MainDevice(Segment([Coupler(), servo])) as main:
        yield main.scan()[1]


def store(servo: Servo, *text_ids: int) -> None:
    for text_id in text_ids:
        servo.store_diagnosis(text_id)


def ids(sub: cat.SubDevice) -> list[int]:
    return [each.text_id for each in sub.diagnosis.messages()]


def number(sub: cat.SubDevice, subindex: int) -> int:
    return sub.sdo.read(0x10F3, subindex, type=USINT)


def test_an_empty_history(sub: cat.SubDevice) -> None:
    assert sub.diagnosis.messages() == ()
    sub.diagnosis.acknowledge()  # nothing to acknowledge
    assert (number(sub, 2), number(sub, 3)) == (0, 0)


def test_messages_are_returned_oldest_first(servo: Servo, sub: cat.SubDevice) -> None:
    store(servo, 1, 2, 3)
    assert ids(sub) == [1, 2, 3]


@pytest.mark.parametrize("count", range(4, 11))
def test_the_ring_keeps_the_newest_messages(servo: Servo, sub: cat.SubDevice, count: int) -> None:
    store(servo, *range(1, count + 1))
    assert ids(sub) == list(range(count - 3, count + 1))
    assert bool(sub.sdo.read(0x10F3, 5, type=UINT) & 0x20) is (count > 4)


def test_reading_the_newest_message_clears_the_flag(servo: Servo, sub: cat.SubDevice) -> None:
    store(servo, 1, 2)
    assert sub.sdo.read(0x10F3, 4, type=BOOL)
    sub.diagnosis.messages()
    assert not sub.sdo.read(0x10F3, 4, type=BOOL)


def test_acknowledged_messages(servo: Servo, sub: cat.SubDevice) -> None:
    store(servo, 1, 2)
    sub.diagnosis.acknowledge()
    store(servo, 3)
    assert [each.acknowledged for each in sub.diagnosis.messages()] == [True, True, False]
    assert number(sub, 3) == 7


def test_a_message_that_arrives_after_the_reading_is_not_acknowledged(
    servo: Servo, sub: cat.SubDevice
) -> None:
    store(servo, 1, 2)
    known = sub.diagnosis.messages()
    store(servo, 3)
    sub.diagnosis.acknowledge(known[-1])
    assert [each.acknowledged for each in sub.diagnosis.messages()] == [True, True, False]


@pytest.mark.parametrize("call", ["messages", "acknowledge"])
def test_an_impossible_number_names_the_device(
    sub: cat.SubDevice, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def upload(index: int, subindex: int) -> Procedure[bytes]:
        return b"\x2c\x01"  # 300
        yield []

    monkeypatch.setattr(sub.sdo, "upload_small", upload)
    with pytest.raises(DecodeError, match=r"device 1 \(.*\): .*0x10F3:02.*received 300"):
        getattr(sub.diagnosis, call)()


def test_clear_deletes_all_messages(servo: Servo, sub: cat.SubDevice) -> None:
    store(servo, 1, 2, 3, 4, 5, 6)
    sub.diagnosis.clear()
    assert sub.diagnosis.messages() == ()
    store(servo, 7)
    assert ids(sub) == [7]


def test_the_acknowledge_mode_keeps_unacknowledged_messages(
    servo: Servo, sub: cat.SubDevice
) -> None:
    sub.sdo.write(0x10F3, 5, ACKNOWLEDGE_MODE, type=UINT)
    store(servo, 1, 2, 3, 4, 5, 6)
    assert ids(sub) == [1, 2, 3, 4]
    assert sub.sdo.read(0x10F3, 5, type=UINT) == ACKNOWLEDGE_MODE | 0x20
    sub.diagnosis.acknowledge()
    store(servo, 7)
    assert ids(sub) == [2, 3, 4, 7]
    sub.diagnosis.clear()  # only the acknowledged ones
    assert ids(sub) == [7]


@pytest.mark.parametrize(
    ("value", "code"),
    [(1, 0x06090032), (5, 0x06090032), (8, 0x06090030), (10, 0x06090031), (255, 0x06090031)],
)
def test_the_standard_names_the_abort_codes(
    servo: Servo, sub: cat.SubDevice, value: int, code: int
) -> None:
    """As in the manual of WAGO 765-1205: too low, not a message, too high."""
    store(servo, 1)
    with pytest.raises(SdoAbort) as caught:
        sub.sdo.write(0x10F3, 3, value, type=USINT)
    assert caught.value.code == code


def test_a_severity_can_be_disabled(servo: Servo, sub: cat.SubDevice) -> None:
    sub.sdo.write(0x10F3, 5, 0x02, type=UINT)
    servo.store_diagnosis(1, severity="info")
    servo.store_diagnosis(2, severity="warning")
    assert ids(sub) == [2]
    with pytest.raises(SdoAbort):
        sub.sdo.write(0x10F3, 5, 0x8000, type=UINT)


def test_a_message_has_a_type_a_code_and_an_age(servo: Servo, sub: cat.SubDevice) -> None:
    servo.store_diagnosis(9, [4711, 5], severity="warning", code=0x1234_E001)
    (message,) = sub.diagnosis.messages()
    assert (message.severity, message.code, message.text_id) == ("warning", 0x1234_E001, 9)
    assert message.parameters == (4711, 5)
    assert message.local_time
    assert message.age is not None
    assert 0 < message.age < 1
    assert message.time is not None
    assert message.time < sub.sdo.read(0x10F8, type=ULINT) * 1e-9
    assert str(message).startswith("warning: code 0x1234E001, text 0x0009, parameters 4711, 5")


def test_a_refused_state_is_a_message(servo: Servo, sub: cat.SubDevice) -> None:
    sub.sdo.write(0x1C32, 1, 2, type=UINT)  # DC, but the SYNC unit is off
    with pytest.raises(cat.StateError):
        sub.request_state("SAFE_OP")
    messages = sub.main.scan()[1].diagnosis.messages()  # type: ignore[attr-defined]
    assert [(each.text_id, each.error_code, each.parameters) for each in messages] == [
        (REFUSED, 0xA030, (4, 0x30))
    ]


def test_texts_come_from_the_esi(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, servo: Servo
) -> None:
    servo_file.write(tmp_path, profile=with_texts(TEXTS))
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path))
    with cat.MainDevice(Segment([Coupler(), servo])) as main:
        sub = main.scan()[1]
        assert sub.diagnosis.texts == TEXTS
        servo.store_diagnosis(FAULT, [0x8611])
        servo.store_diagnosis(REFUSED, [4, 0x1D])
        assert [each.text for each in sub.diagnosis.messages()] == [
            "Fault 0x8611",
            "Request for state 4 refused with AL status code 0x001D",
        ]


def test_a_device_without_a_history_is_named() -> None:
    with cat.MainDevice("virtual") as main:
        subs = main.scan()
        with pytest.raises(MailboxError, match=r"device 2 \(Catenary virtual servo 1\) has no"):
            subs[2].diagnosis.messages()
        with pytest.raises(MailboxError, match="has no mailbox"):
            subs[1].diagnosis.messages()
        counters = subs[2].diagnosis.synchronisation()
        assert [each.direction for each in counters] == ["outputs", "inputs"]
        assert list(counters[0].by_counter.values()) == [0, 0, 0, 0]


def test_complete_access_is_refused(sub: cat.SubDevice) -> None:
    """As in Beckhoff's slave stack code (diag.c, Read0x10F3)."""
    with pytest.raises(SdoAbort):
        sub.sdo.read(0x10F3, 0, complete=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [({"messages": 251}, "messages must"), ({"message_bytes": 8}, "message_bytes must")],
)
def test_impossible_options_are_refused(arguments: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HistoryOptions(**arguments)


def test_a_message_needs_a_history() -> None:
    servo = Servo()
    with cat.MainDevice(Segment([servo])) as main:
        main.scan()
        with pytest.raises(ValueError, match="has no history"):
            servo.store_diagnosis(1)
