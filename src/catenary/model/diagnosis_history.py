"""Diagnosis of a device: messages with their texts, and counters of its synchronisation.

The messages are those of object 0x10F3 (ETG.1020 §13). The counters are subindices of 0x1C32
(outputs) and 0x1C33 (inputs).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from catenary.model.diagnosis_text import Value, message_text, parameter_value
from catenary.wire.diagnosis_history import DiagnosisMessage, DiagnosisType, HistoryFlags

OUTPUT_PARAMETERS, INPUT_PARAMETERS = 0x1C32, 0x1C33


class SyncCounter(IntEnum):
    """Subindices of 0x1C32 and 0x1C33 that count errors of the synchronisation."""

    MISSED = 0x0B  # pulses without new process data before them
    EXCEEDED = 0x0C  # cycles in which the device did not finish its work
    SHIFT_TOO_SHORT = 0x0D  # pulses shortly after the process data
    ERROR = 0x20  # 1 while the device is not synchronised

    @property
    def text(self) -> str:
        """Meaning, for messages."""
        return SYNC_TEXTS[self]


SYNC_TEXTS = {
    SyncCounter.MISSED: "SM events missed: no new process data before the SYNC pulse",
    SyncCounter.EXCEEDED: "cycle time too small: the device did not finish in time",
    SyncCounter.SHIFT_TOO_SHORT: "shift too short: process data arrived shortly before the pulse",
    SyncCounter.ERROR: "the device is not synchronised",
}


@dataclass(frozen=True, slots=True)
class SyncCounters:
    """Counters of one direction of a device. A counter that the device lacks is None."""

    index: int  # 0x1C32: outputs; 0x1C33: inputs
    missed: int | None = None
    exceeded: int | None = None
    shift_too_short: int | None = None
    error: int | None = None

    @property
    def direction(self) -> str:
        """Direction of the process data: "outputs" or "inputs"."""
        return "outputs" if self.index == OUTPUT_PARAMETERS else "inputs"

    @property
    def by_counter(self) -> Mapping[SyncCounter, int]:
        """Counters that the device has."""
        numbers = zip(
            SyncCounter, (self.missed, self.exceeded, self.shift_too_short, self.error), strict=True
        )
        return {counter: number for counter, number in numbers if number is not None}


@dataclass(frozen=True, slots=True)
class HistoryMessage:
    """Message of a device's diagnosis history.

    `age` is the time since the message [s]; None if the device has no clock for it. `time` is the
    time stamp of the device [s]: of its own clock if `local_time`, otherwise since 2000.
    """

    subindex: int  # place in 0x10F3
    severity: str  # "info", "warning", "error", or "type N" for a reserved number
    text: str
    code: int  # diagnosis code, 32 bits
    error_code: int | None  # emergency error code in `code`, if any
    text_id: int  # 0: none
    time: float | None  # None: the message has no time
    local_time: bool
    age: float | None
    parameters: tuple[Value, ...]
    acknowledged: bool
    data: bytes  # the message as read

    def __str__(self) -> str:
        age = "" if self.age is None else f", {self.age:.3f} s ago"
        return f"{self.severity}: {self.text} (code 0x{self.code:08X}{age})"


@dataclass(frozen=True, slots=True)
class RawMessage:
    """Subindex with its bytes and the decoded message; None if it cannot be decoded."""

    subindex: int
    data: bytes
    message: DiagnosisMessage | None
    acknowledged: bool = False


@dataclass(frozen=True, slots=True)
class RawHistory:
    """Present state of object 0x10F3, with messages from the oldest to the newest."""

    maximum: int
    newest: int
    acknowledged: int
    available: bool  # True if there are new messages
    flags: HistoryFlags
    messages: tuple[RawMessage, ...] = ()
    now_ns: int | None = None  # 0x10F8; None if the device does not have it


def described(raw: RawMessage, texts: Mapping[int, str], now_ns: int | None) -> HistoryMessage:
    """Return a message with its text and age.

    Args:
        raw: Message as read.
        texts: Texts of the device by text ID, from its ESI.
        now_ns: Present time of the device, 0x10F8 [ns]; None if unknown.
    """
    message = raw.message
    if message is None:
        text = f"malformed message of {len(raw.data)} bytes: {raw.data[:32].hex(' ')}"
        unknown = (None, 0, None, False, None, ())
        return HistoryMessage(raw.subindex, "error", text, 0, *unknown, raw.acknowledged, raw.data)
    age = None
    if message.time_ns and now_ns is not None and now_ns >= message.time_ns:
        age = (now_ns - message.time_ns) * 1e-9
    return HistoryMessage(
        subindex=raw.subindex,
        severity=severity_name(message.type),
        text=message_text(message, texts),
        code=message.code,
        error_code=message.error_code,
        text_id=message.text_id,
        time=message.time_ns * 1e-9 if message.time_ns else None,
        local_time=message.local_time,
        age=age,
        parameters=tuple(parameter_value(each, texts) for each in message.parameters),
        acknowledged=raw.acknowledged,
        data=raw.data,
    )


def severity_name(number: int) -> str:
    """Return the name of a severity."""
    try:
        return DiagnosisType(number).name.lower()
    except ValueError:
        return f"type {number}"
