"""Contents of events: mailbox messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from catenary.capture.text import value_text
from catenary.wire.abort import abort_code
from catenary.wire.mailbox import ErrorReply, Type
from catenary.wire.sdo_information import Opcode

_PROTOCOLS = {
    Type.AOE: "AoE",
    Type.EOE: "EoE",
    Type.COE: "CoE",
    Type.FOE: "FoE",
    Type.SOE: "SoE",
    Type.VOE: "VoE",
}


@dataclass(frozen=True, slots=True)
class SdoTransfer:
    """A complete SDO transfer: a download (`writes`) or an upload.

    `data` is the transferred value, joined from all segments. `abort` is the abort code; None if
    the transfer was not aborted. `answered` is False if the capture has no answer, or lacks a
    segment of a download.
    """

    writes: bool
    index: int
    subindex: int
    data: bytes
    complete_access: bool = False
    abort: int | None = None
    answered: bool = True
    segments: int = 0
    duration_ns: int | None = None

    @property
    def kind(self) -> str:
        """`sdo-write` or `sdo-read`."""
        return "sdo-write" if self.writes else "sdo-read"

    @property
    def succeeded(self) -> bool:
        """True if the device answered without an abort."""
        return self.answered and self.abort is None

    @property
    def place(self) -> str:
        """Index and subindex, such as 0x1C12:01, or 0x1C12 complete."""
        if self.complete_access:
            return f"0x{self.index:04X}:{self.subindex:02X} complete"
        return f"0x{self.index:04X}:{self.subindex:02X}"

    def __str__(self) -> str:
        value = f" = {value_text(self.data)}" if self.data or self.succeeded else ""
        text = f"{'write' if self.writes else 'read'} {self.place}{value}"
        if self.segments:
            text += f" ({self.segments} segments)"
        if self.abort is not None:
            text += f" aborted: 0x{self.abort:08X} {abort_code(self.abort).text}"
        return text if self.answered else f"{text} not answered"


@dataclass(frozen=True, slots=True)
class SdoInformationRead:
    """An SDO information service. `size` is the length of the joined answer [bytes]."""

    kind: ClassVar[str] = "sdo-information"
    opcode: Opcode  # of the request
    index: int  # for the object list: the kind of list
    subindex: int = 0
    size: int = 0
    abort: int | None = None
    answered: bool = True

    def __str__(self) -> str:
        place = {
            Opcode.LIST_REQUEST: f"object list {self.index}",
            Opcode.OBJECT_REQUEST: f"description of 0x{self.index:04X}",
        }.get(self.opcode, f"description of 0x{self.index:04X}:{self.subindex:02X}")
        if not self.answered:
            return f"SDO information: {place}, not answered"
        if self.abort is not None:
            return f"SDO information: {place}, aborted: 0x{self.abort:08X}"
        return f"SDO information: {place}, {self.size} bytes"


@dataclass(frozen=True, slots=True)
class EmergencyReceived:
    """The device sent an emergency message."""

    kind: ClassVar[str] = "emergency"
    error_code: int
    error_register: int
    data: bytes

    def __str__(self) -> str:
        return (
            f"emergency 0x{self.error_code:04X}, error register 0x{self.error_register:02X}, "
            f"data {self.data.hex()}"
        )


@dataclass(frozen=True, slots=True)
class MailboxMessage:
    """A mailbox message of another protocol than CoE, or one that cannot be decoded."""

    kind: ClassVar[str] = "mailbox"
    protocol: Type
    to_device: bool
    size: int
    text: str = ""  # service of the protocol

    def __str__(self) -> str:
        direction = "to the device" if self.to_device else "from the device"
        text = f" {self.text}" if self.text else ""
        return f"{_PROTOCOLS.get(self.protocol, self.protocol.name)}{text} {direction}"


@dataclass(frozen=True, slots=True)
class MailboxFault:
    """The device refused a mailbox message."""

    kind: ClassVar[str] = "mailbox-error"
    code: int

    def __str__(self) -> str:
        return f"mailbox error 0x{self.code:04X}: {ErrorReply(self.code).text}"
