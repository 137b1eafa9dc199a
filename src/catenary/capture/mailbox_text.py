"""Services of the mailbox protocols AoE, EoE, FoE, SoE and VoE, ETG.1000.6 §5, ETG.1020."""

from __future__ import annotations

from catenary.errors import DecodeError
from catenary.wire import aoe, foe, voe
from catenary.wire.mailbox import Mailbox, Type

_AOE_SERVICES = {int(each): each.name.lower().replace("_", " ") for each in aoe.Command}
_FOE_SERVICES = {
    foe.ReadRequest: "read request",
    foe.WriteRequest: "write request",
    foe.Data: "data",
    foe.Acknowledge: "acknowledge",
    foe.Error: "error",
    foe.Busy: "busy",
}
_SOE_SERVICES = {
    1: "read request",
    2: "read response",
    3: "write request",
    4: "write response",
    5: "notification",
    6: "emergency",
}
_SOE_ERROR = 0x10  # bit of the first byte
_EOE_SERVICES = {
    0: "frame fragment",
    1: "time stamp response",
    2: "set IP parameter request",
    3: "set IP parameter response",
    4: "set filter request",
    5: "set filter response",
    6: "get IP parameter request",
    7: "get IP parameter response",
    8: "get filter request",
    9: "get filter response",
}


def service_text(mailbox: Mailbox) -> str:
    """Return the service of a message, as far as it is known; empty if it is not."""
    if mailbox.type is Type.FOE and len(mailbox.data) >= foe.HEADER_SIZE:
        return _foe(mailbox.data)
    if mailbox.type is Type.SOE and len(mailbox.data) >= 4:
        return _soe(mailbox.data)
    if mailbox.type is Type.EOE and mailbox.data:
        return _EOE_SERVICES.get(mailbox.data[0] & 0x0F, "")
    if mailbox.type is Type.AOE:
        return _aoe(mailbox.data)
    if mailbox.type is Type.VOE and len(mailbox.data) >= voe.HEADER_SIZE:
        message = voe.decode_voe(mailbox.data)
        return f"vendor 0x{message.vendor:X} type {message.type}, {len(message.data)} bytes"
    return ""


def _aoe(data: bytes) -> str:
    try:
        message = aoe.decode_aoe(data)
    except DecodeError:
        return ""
    if isinstance(message, aoe.Fragment):
        kind = "acknowledge fragment" if message.is_response else "fragment"
        return f"{kind} {message.number}, {len(message.data)} bytes"
    text = _AOE_SERVICES.get(message.command, f"service {message.command}")
    if message.command == aoe.Command.NOTIFICATION:
        return f"{text} at port {message.source.port}, {len(message.data)} bytes"
    if not message.is_response:
        return f"{text} request {message.invoke_id} at port {message.target.port}"
    failure = f", error 0x{message.error:04X}" if message.error else ""
    return f"{text} response {message.invoke_id}, {len(message.data)} bytes{failure}"


def _foe(data: bytes) -> str:
    try:
        message = foe.decode_foe(data)
    except DecodeError:
        return f"service {data[0]}"
    text = _FOE_SERVICES[type(message)]
    match message:
        case foe.ReadRequest(name) | foe.WriteRequest(name):
            return f"{text} {name!r}"
        case foe.Data(packet, data):
            return f"{text} {packet}, {len(data)} bytes"
        case foe.Acknowledge(packet):
            return f"{text} {packet}"
        case foe.Error(code, words):
            meaning = foe.error_meaning(code).text
            return f"{text} 0x{code:04X}: {meaning}" + (f" ({words})" if words else "")
        case foe.Busy(done, entire):
            return f"{text} {done}/{entire}"


def _soe(data: bytes) -> str:
    service, drive = data[0] & 0x07, data[0] >> 5
    number = int.from_bytes(data[2:4], "little")
    kind = "P" if number & 0x8000 else "S"
    text = f"{_SOE_SERVICES.get(service, f'service {service}')} {kind}-{number >> 12 & 7}-"
    text += f"{number & 0x0FFF:04d} drive {drive}"
    if data[0] & _SOE_ERROR:
        return f"{text} error 0x{int.from_bytes(data[-2:], 'little'):04X}"
    return text
