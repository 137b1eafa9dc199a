"""Diagnosis history of a device (0x10F3, 0x10F8) and its synchronisation counters (0x1C32, 0x1C33).

The messages form a ring. They are read from the newest one backwards, so that a reader that knows
the last message reads only the new ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from catenary.errors import DecodeError, SdoAbort
from catenary.model.diagnosis_history import (
    INPUT_PARAMETERS,
    OUTPUT_PARAMETERS,
    RawHistory,
    RawMessage,
    SyncCounter,
    SyncCounters,
)
from catenary.procedure.exchange import Procedure
from catenary.wire.diagnosis_history import (
    ACKNOWLEDGED,
    AVAILABLE,
    FIRST_MESSAGE,
    FLAGS,
    HIGHEST_SUBINDEX,
    HISTORY,
    MAXIMUM,
    MESSAGES_MAX,
    NEWEST,
    TIMESTAMP,
    DiagnosisMessage,
    HistoryFlags,
    decode_diagnosis_message,
    is_empty,
)

Upload: TypeAlias = Callable[[int, int], Procedure[bytes]]  # reads an entry: index, subindex


def read_state(upload: Upload) -> Procedure[RawHistory]:
    """Read subindices 1 to 5 of the history. A maximum of 0 is taken from subindex 0.

    Args:
        upload: Function that reads an entry.

    Raises:
        SdoAbort: The device has no diagnosis history.
        DecodeError: The number of the newest message is impossible.
    """
    newest = yield from read_newest(upload)
    maximum = yield from _optional(upload, MAXIMUM)
    if not maximum:
        highest = yield from _optional(upload, HIGHEST_SUBINDEX)
        maximum = max(highest - FIRST_MESSAGE + 1, 0)
    acknowledged = yield from _optional(upload, ACKNOWLEDGED)
    available = yield from _optional(upload, AVAILABLE)
    flags = yield from _optional(upload, FLAGS)
    return RawHistory(
        maximum=maximum,
        newest=newest,
        acknowledged=acknowledged,
        available=bool(available & 1),
        flags=HistoryFlags(flags & 0xFFFF),
    )


def read_newest(upload: Upload) -> Procedure[int]:
    """Read the subindex of the newest message; 0 if there is none.

    Args:
        upload: Function that reads an entry.

    Raises:
        SdoAbort: The device has no diagnosis history.
        DecodeError: The number is not the subindex of a message.
    """
    newest = yield from _number(upload, NEWEST)
    if newest < FIRST_MESSAGE:
        return 0  # slave stack code: 5 if all acknowledged messages have been deleted
    if newest >= FIRST_MESSAGE + MESSAGES_MAX:
        raise DecodeError(
            f"newest diagnosis message (0x10F3:02): received {newest}, must be 0, or "
            f"{FIRST_MESSAGE} to {FIRST_MESSAGE + MESSAGES_MAX - 1}"
        )
    return newest


def read_history(
    upload: Upload,
    last: RawMessage | None = None,
    *,
    limit: int = MESSAGES_MAX,
    state: RawHistory | None = None,
) -> Procedure[RawHistory]:
    """Read the history with its messages, oldest first.

    Args:
        upload: Function that reads an entry.
        last: Last known message. Only newer messages are read; None: all messages.
        limit: Largest number of messages; the newest ones are read.
        state: Result of `read_state`; None: it is read first.

    Raises:
        SdoAbort: The device has no diagnosis history.
        DecodeError: The number of the newest message is impossible.
    """
    if state is None:
        state = yield from read_state(upload)
    messages = yield from _messages(upload, state, last, limit)
    now_ns = (yield from _time(upload)) if messages else None
    return replace(state, messages=acknowledged_up_to(messages, state.acknowledged), now_ns=now_ns)


def read_sync_counters(upload: Upload) -> Procedure[tuple[SyncCounters, ...]]:
    """Read the synchronisation counters of outputs and inputs. Missing objects are omitted.

    Args:
        upload: Function that reads an entry.
    """
    found = []
    for index in (OUTPUT_PARAMETERS, INPUT_PARAMETERS):
        numbers = []
        for counter in SyncCounter:
            numbers.append((yield from _entry(upload, index, counter)))
        if any(number is not None for number in numbers):
            found.append(SyncCounters(index, *numbers))
    return tuple(found)


def acknowledged_up_to(
    messages: tuple[RawMessage, ...], acknowledged: int
) -> tuple[RawMessage, ...]:
    """Mark the acknowledged messages: the one in this subindex, and all older ones.

    Args:
        messages: Messages, oldest first.
        acknowledged: Subindex of the newest acknowledged message; 0: none.
    """
    subindices = [each.subindex for each in messages]
    count = subindices.index(acknowledged) + 1 if acknowledged in subindices else 0
    return tuple(replace(each, acknowledged=n < count) for n, each in enumerate(messages))


def _messages(
    upload: Upload, state: RawHistory, last: RawMessage | None, limit: int
) -> Procedure[tuple[RawMessage, ...]]:
    """Read the messages backwards from the newest one, and return them oldest first."""
    newest = state.newest
    if not newest:
        return ()
    room = min(max(state.maximum, newest - FIRST_MESSAGE + 1), MESSAGES_MAX)
    found: list[RawMessage] = []
    for back in range(min(room, limit)):
        subindex = FIRST_MESSAGE + (newest - FIRST_MESSAGE - back) % room
        try:
            data = yield from upload(HISTORY, subindex)
        except SdoAbort:
            break  # slave stack code: subindex 0 is the highest one with a message
        if is_empty(data) or _is_known(last, subindex, data):
            break
        found.append(RawMessage(subindex, data, _decoded(data)))
    if len(found) == room:
        found = yield from _without_replaced(upload, found, newest)
    return tuple(reversed(found))


def _without_replaced(
    upload: Upload, found: list[RawMessage], newest: int
) -> Procedure[list[RawMessage]]:
    """Drop the last messages of a full ring if newer ones have replaced them during the reading.

    Args:
        upload: Function that reads an entry.
        found: Messages of all subindices, newest first.
        newest: Subindex of the newest message before the reading.
    """
    now = yield from read_newest(upload)
    replaced = (now - newest) % len(found) if now else 0
    return found[: len(found) - replaced]


def _is_known(last: RawMessage | None, subindex: int, data: bytes) -> bool:
    """Return True for the last known message. A device may move a message with a time stamp."""
    if last is None or last.data != data:
        return False
    return last.subindex == subindex or (last.message is not None and last.message.time_ns != 0)


def _decoded(data: bytes) -> DiagnosisMessage | None:
    try:
        return decode_diagnosis_message(data)
    except DecodeError:
        return None


def _number(upload: Upload, subindex: int) -> Procedure[int]:
    data = yield from upload(HISTORY, subindex)
    return int.from_bytes(data[:2], "little")


def _optional(upload: Upload, subindex: int) -> Procedure[int]:
    """Read a number of the history; 0 if the device does not have it."""
    try:
        return (yield from _number(upload, subindex))
    except SdoAbort:
        return 0


def _time(upload: Upload) -> Procedure[int | None]:
    return (yield from _entry(upload, TIMESTAMP, 0))


def _entry(upload: Upload, index: int, subindex: int) -> Procedure[int | None]:
    """Read a number; None if the device does not have it."""
    try:
        data = yield from upload(index, subindex)
    except SdoAbort:
        return None
    return int.from_bytes(data[:8], "little")
