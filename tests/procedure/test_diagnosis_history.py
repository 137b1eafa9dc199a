"""Diagnosis history of a device, read through a function that serves a dictionary."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError, SdoAbort
from catenary.model.diagnosis_history import RawMessage, SyncCounter, described
from catenary.procedure.diagnosis_history import (
    Upload,
    acknowledged_up_to,
    read_history,
    read_newest,
    read_sync_counters,
)
from catenary.procedure.exchange import Procedure
from catenary.wire.diagnosis_history import (
    MESSAGES_MAX,
    DiagnosisMessage,
    HistoryFlags,
    decode_diagnosis_message,
)
from tests.procedure.player import play

Objects = dict[tuple[int, int], bytes]
MISSING = 0x0602_0000


def from_objects(objects: Objects, asked: list[tuple[int, int]] | None = None) -> Upload:
    def upload(index: int, subindex: int) -> Procedure[bytes]:
        if asked is not None:
            asked.append((index, subindex))
        if (index, subindex) not in objects:
            raise SdoAbort("missing", position=3, index=index, subindex=subindex, code=MISSING)
        return objects[index, subindex]
        yield []

    return upload


def run(procedure: Procedure):  # type: ignore[no-untyped-def, type-arg]
    return play(procedure, lambda request: pytest.fail(f"unexpected {request}"))


def message(number: int, time_ns: int = 0) -> bytes:
    return DiagnosisMessage(0xE000, 2, number, time_ns).encode()


def history(newest: int, stored: dict[int, bytes], maximum: int = 4) -> Objects:
    numbers = {1: maximum, 2: newest, 3: 0, 4: 1, 5: 0}
    return {(0x10F3, n): bytes((value,)) for n, value in numbers.items()} | {
        (0x10F3, n): data for n, data in stored.items()
    }


def ids(objects: Objects, last: RawMessage | None = None, **options: int) -> list[int]:
    found = run(read_history(from_objects(objects), last, **options))
    return [each.message.text_id for each in found.messages]


def test_a_device_without_a_history() -> None:
    with pytest.raises(SdoAbort):
        run(read_history(from_objects({})))
    with pytest.raises(SdoAbort):
        run(read_newest(from_objects({})))


def test_a_ring_that_has_wrapped() -> None:
    stored = {6: message(5), 7: message(6), 8: message(3), 9: message(4)}
    assert ids(history(7, stored)) == [3, 4, 5, 6]


def test_a_ring_that_is_not_full() -> None:
    stored = {6: message(1), 7: message(2)}
    assert ids(history(7, stored)) == [1, 2]  # the slave stack code refuses subindices 8 and 9
    assert ids(history(7, stored | {8: bytes(20), 9: bytes(20)})) == [1, 2]


def test_only_messages_after_the_last_known_one_are_read() -> None:
    stored = {6: message(5), 7: message(6), 8: message(3), 9: message(4)}
    known = RawMessage(9, stored[9], None)
    assert ids(history(7, stored), known) == [5, 6]
    assert ids(history(9, stored), known) == []


def test_a_moved_message_is_recognised_by_its_time() -> None:
    """Deleting acknowledged messages moves the others in the slave stack code."""
    data = message(4, time_ns=17)
    known = RawMessage(9, data, decode_diagnosis_message(data))
    assert ids(history(7, {6: data, 7: message(5, 18)}), known) == [5]


def test_a_limit() -> None:
    stored = {6: message(5), 7: message(6), 8: message(3), 9: message(4)}
    assert ids(history(7, stored), limit=2) == [5, 6]


def test_a_maximum_of_0_does_not_hide_messages() -> None:
    """Beckhoff's EP3632 states 0 as its default."""
    assert ids(history(8, {n: message(n) for n in range(6, 9)}, maximum=0)) == [6, 7, 8]


def test_a_maximum_of_0_is_taken_from_subindex_0() -> None:
    """Beckhoff's EP3632: subindex 0 is 21, and it stores 16 messages."""
    objects = history(7, {n: message(n) for n in range(6, 22)}, maximum=0)
    objects[0x10F3, 0] = bytes((21,))
    assert ids(objects) == [*range(8, 22), 6, 7]


def test_the_flags_and_the_time_of_the_device() -> None:
    objects = history(6, {6: message(1, 10**9)}) | {(0x10F8, 0): (3 * 10**9).to_bytes(8, "little")}
    objects[0x10F3, 5] = b"\x31\0"
    found = run(read_history(from_objects(objects)))
    assert found.available
    assert found.flags == HistoryFlags.EMERGENCY | HistoryFlags.ACKNOWLEDGE_MODE | 0x20
    assert described(found.messages[0], {1: "hot"}, found.now_ns).age == 2.0


def test_an_impossible_number_of_the_newest_message_is_an_error() -> None:
    objects = history(6, {6: message(1)}) | {(0x10F3, 2): b"\x2c\x01"}
    for procedure in (read_history, read_newest):
        with pytest.raises(DecodeError, match=r"0x10F3:02.*received 300, must be 0, or 6 to 255"):
            run(procedure(from_objects(objects)))


def test_a_newest_message_of_5_is_an_empty_history() -> None:
    """Slave stack code (diag.c, ClearMessageHistory): all acknowledged messages were deleted."""
    assert ids(history(5, {6: message(1)})) == []
    assert run(read_newest(from_objects(history(5, {})))) == 0


@pytest.mark.parametrize("newest", range(6, 10))
def test_messages_that_arrive_during_the_reading_are_left_for_the_next_one(newest: int) -> None:
    """They replace the oldest messages of a full ring, which are read last."""
    stored = {6 + (newest - 6 - back) % 4: message(10 - back) for back in range(4)}
    objects = history(newest, stored)
    upload = from_objects(objects)

    def arriving(index: int, subindex: int) -> Procedure[bytes]:
        data = yield from upload(index, subindex)
        if subindex == newest:  # two messages arrive
            for number in (1, 2):
                objects[0x10F3, 6 + (newest - 6 + number) % 4] = message(10 + number)
            objects[0x10F3, 2] = bytes((6 + (newest - 6 + 2) % 4,))
        return data

    found = run(read_history(arriving))
    assert [each.message.text_id for each in found.messages] == [9, 10]
    assert ids(objects, found.messages[-1]) == [11, 12]


def test_a_malformed_message_is_shown() -> None:
    found = run(read_history(from_objects(history(6, {6: b"\x01\x02"}))))
    shown = described(found.messages[0], {}, None)
    assert (shown.severity, shown.text) == ("error", "malformed message of 2 bytes: 01 02")


@given(st.integers(0, 255), st.integers(0, 255), st.binary(min_size=1, max_size=40))
def test_any_numbers_end_after_a_bounded_number_of_requests(
    newest: int, maximum: int, data: bytes
) -> None:
    asked: list[tuple[int, int]] = []
    stored = dict.fromkeys(range(6, 256), data)
    run(read_history(from_objects(history(newest, stored, maximum), asked)))
    assert len(asked) <= 6 + MESSAGES_MAX + 2


def test_acknowledged_messages() -> None:
    messages = tuple(RawMessage(n, b"", None) for n in (8, 9, 6, 7))
    for subindex, expected in ((6, 3), (8, 1), (7, 4), (0, 0), (5, 0)):
        marked = acknowledged_up_to(messages, subindex)
        assert [each.acknowledged for each in marked] == [n < expected for n in range(4)]


def test_counters_that_a_device_lacks() -> None:
    assert run(read_sync_counters(from_objects({}))) == ()
    objects = {(0x1C33, 0x0B): b"\x05\0", (0x1C33, 0x20): b"\x01"}
    (inputs,) = run(read_sync_counters(from_objects(objects)))
    assert inputs.direction == "inputs"
    assert inputs.by_counter == {SyncCounter.MISSED: 5, SyncCounter.ERROR: 1}
