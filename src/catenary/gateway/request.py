"""Messages of clients: the kind of access that each requests.

Everything that is not known to be a read counts as a write.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from catenary.errors import DecodeError
from catenary.wire import coe, foe
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.sdo_information import Opcode, SdoInformation

INFORMATION_REQUESTS = (Opcode.LIST_REQUEST, Opcode.OBJECT_REQUEST, Opcode.ENTRY_REQUEST)


class Access(Enum):
    """Kind of access that a message requests."""

    READ = auto()  # begins a transfer from the device
    WRITE = auto()  # begins a transfer to the device
    CONTINUE = auto()  # next message of a transfer
    END = auto()  # end of a transfer without an answer
    OTHER = auto()  # not parsed


@dataclass(frozen=True, slots=True)
class Request:
    """Message of a client, as far as the gateway understands it."""

    message: Mailbox
    access: Access
    what: str  # for events and the log
    parsed: coe.Message | foe.Message | None = None
    index: int | None = None
    subindex: int | None = None

    @property
    def data(self) -> bytes:
        """Data that the message writes; all of its data if it is not parsed."""
        match self.parsed:
            case coe.DownloadRequest(data=data) | foe.Data(data=data):
                return data
        return self.message.data


def read_request(message: Mailbox) -> Request:
    """Return a message of a client with its meaning."""
    try:
        if message.type is Type.COE:
            return _coe_request(message)
        if message.type is Type.FOE:
            return _foe_request(message)
    except DecodeError as error:
        return Request(message, Access.OTHER, f"invalid {message.type.name} message ({error})")
    return Request(message, Access.OTHER, f"{message.type.name} message")


def _coe_request(message: Mailbox) -> Request:
    parsed = coe.decode_coe(message.data)
    service = int.from_bytes(message.data[: coe.HEADER_SIZE], "little") >> 12
    if isinstance(parsed, SdoInformation) and parsed.opcode in INFORMATION_REQUESTS:
        return Request(message, Access.READ, "SDO information", parsed)
    if service == coe.Service.SDO_REQUEST:
        match parsed:
            case coe.UploadRequest(index=index, subindex=subindex):
                what = f"SDO upload 0x{index:04X}:{subindex:02X}"
                return Request(message, Access.READ, what, parsed, index, subindex)
            case coe.DownloadRequest(index=index, subindex=subindex):
                what = f"SDO download 0x{index:04X}:{subindex:02X}"
                return Request(message, Access.WRITE, what, parsed, index, subindex)
            case coe.UploadSegmentRequest() | coe.DownloadSegment():
                return Request(message, Access.CONTINUE, "SDO segment", parsed)
            case coe.Abort(index=index, subindex=subindex):
                return Request(message, Access.END, "SDO abort", parsed, index, subindex)
    return Request(message, Access.OTHER, f"CoE message of service {service}")


def _foe_request(message: Mailbox) -> Request:
    parsed = foe.decode_foe(message.data)
    match parsed:
        case foe.ReadRequest(name=name):
            return Request(message, Access.READ, f"FoE read {name!r}", parsed)
        case foe.WriteRequest(name=name):
            return Request(message, Access.WRITE, f"FoE write {name!r}", parsed)
        case foe.Error():
            return Request(message, Access.END, "FoE error", parsed)
    return Request(message, Access.CONTINUE, "FoE packet", parsed)
