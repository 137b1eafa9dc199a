"""ADS server of a virtual device: memory, objects of CoE, state and notifications, ETG.1020."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum

from catenary.virtual.aoe.messages import (
    ADS_COMMAND,
    FRAGMENT,
    HEADER_SIZE,
    NO_RETURN,
    RESPONSE,
    Assembly,
    Head,
    decode_head,
    fragments,
)
from catenary.virtual.aoe.notifications import Notifications
from catenary.virtual.aoe.options import AdsOptions
from catenary.virtual.coe.dictionary import (
    NO_OBJECT,
    NO_SUBINDEX,
    READ_ONLY,
    TOO_LONG,
    TOO_SHORT,
    WRITE_ONLY,
    Abort,
)
from catenary.virtual.mailbox import ERROR_SIZE, ERROR_TOO_SHORT
from catenary.virtual.protocols import Surroundings

NO_PORT, NO_TARGET = 0x0006, 0x0007  # errors of the transport
NO_SERVICE, NO_GROUP, NO_OFFSET, NO_ACCESS, BAD_SIZE = 0x701, 0x702, 0x703, 0x704, 0x705
DEVICE_ERROR = 0x700
OBJECTS, COMPLETE = 0xF302, 0x100  # index group; bit of the index offset
NET_ID = (1, 3)  # index group and offset
RUN = 5
ENDLESS = 200
ABORTS = {
    NO_OBJECT: NO_OFFSET,
    NO_SUBINDEX: NO_OFFSET,
    READ_ONLY: NO_ACCESS,
    WRITE_ONLY: NO_ACCESS,
    TOO_LONG: BAD_SIZE,
    TOO_SHORT: BAD_SIZE,
}


class Service(IntEnum):
    """Command of a request."""

    INFO = 1
    READ = 2
    WRITE = 3
    STATE = 4
    CONTROL = 5
    ADD = 6
    DELETE = 7
    READ_WRITE = 9


class Refusal(Exception):
    """ADS error with which the device answers."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:04X}")
        self.code = code


class AdsServer:
    """Server of one device. It owns the areas, the ADS state and the NetId."""

    def __init__(
        self, options: AdsOptions, areas: Mapping[int, bytearray], surroundings: Surroundings
    ) -> None:
        self._options = options
        self._areas = areas
        self._around = surroundings
        self._assembly = Assembly()
        self._notifications = Notifications(surroundings, self._read)
        self.reset()

    def reset(self) -> None:
        """Discard the NetId, the notifications and all fragments."""
        self._net_id: bytes | None = None
        self._states = (RUN, 0)
        self._packet = 0
        self._held: list[bytes] = []  # fragments that wait for an acknowledgement
        self._assembly.clear()
        self._notifications.clear()

    def serve(self, payload: bytes) -> list[bytes] | int:
        """Return the answers to a message, or the code of a mailbox error."""
        if len(payload) < HEADER_SIZE:
            return ERROR_TOO_SHORT
        head = decode_head(payload)
        if HEADER_SIZE + head.length > len(payload):
            return ERROR_SIZE
        data = payload[HEADER_SIZE : HEADER_SIZE + head.length]
        if head.command == FRAGMENT:
            return self._fragment(head, data)
        return [] if head.flags & RESPONSE else self._answers(head, data)

    def _fragment(self, head: Head, data: bytes) -> list[bytes]:
        if head.flags & RESPONSE:
            return [self._held.pop(0)] if self._held else []
        whole = self._assembly.add(head, data)
        if whole is not None:
            return self._answers(decode_head(whole), whole[HEADER_SIZE:])
        return [] if head.flags & NO_RETURN else [head.answer(length=0).encode()]

    def _answers(self, head: Head, data: bytes) -> list[bytes]:
        if self._options.responses == "none":
            return []
        if self._net_id is None:
            self._net_id = head.target  # of the first request after INIT (SSC, ecataoe.c)
        answer, error = b"", 0
        try:
            answer = self._assigned(head, data)
            if not answer:
                error = self._route(head)
                answer = self._result(head, data) if not error else b""
        except Refusal as refusal:
            answer = struct.pack("<I", refusal.code)
        invoke_id = head.invoke_id + (self._options.invoke_id == "wrong") & 0xFFFF_FFFF
        length = len(answer) + {"right": 0, "long": 7, "short": -1}[self._options.length]
        found = head.answer(length=max(length, 0), error=error, invoke_id=invoke_id)
        if self._options.responses == "endless":
            return [found.answer(invoke_id=invoke_id + 1).encode() + answer] * ENDLESS
        return self._sent(found.encode() + answer)

    def _sent(self, message: bytes) -> list[bytes]:
        """Return a response, in fragments if it exceeds the mailbox."""
        room, mode = self._around.send_room, self._options.fragments
        if len(message) <= room:
            return [message]
        self._packet = self._packet + 1 & 0xFFFF
        parts = list(fragments(message, room, self._packet, 0))
        if mode == "acknowledged":
            self._held = parts[1:]
            return parts[:1]
        if mode == "repeated":
            return [part for part in parts for _ in range(2)]
        if mode == "missing":
            return [parts[0], *parts[2:]]
        if mode == "empty":
            return [parts[0], replace(decode_head(parts[1]), length=0).encode()]
        return parts

    def _assigned(self, head: Head, data: bytes) -> bytes:
        """Take the NetId from a write to group 1, offset 3. Return the result, or empty bytes."""
        own = self._around.station_address()
        if (
            head.command != Service.WRITE
            or len(data) != 18
            or {head.port, head.source_port} != {own}
        ):
            return b""
        group, offset, size = struct.unpack_from("<III", data)
        if (group, offset) != NET_ID or size != 6:
            return b""
        self._net_id = data[12:]
        return bytes(4)

    def _route(self, head: Head) -> int:
        if head.target != self._net_id:
            return NO_TARGET
        return 0 if head.port == self._options.port else NO_PORT

    def _result(self, head: Head, data: bytes) -> bytes:
        match head.command:
            case Service.INFO:
                name = self._options.name.encode()
                return struct.pack("<IBBH16s", 0, *self._options.version, name)
            case Service.STATE:
                return struct.pack("<IHH", 0, *self._states)
            case Service.READ:
                group, offset, size = _numbers("<III", data)
                found = self._read(group, offset, size)
                return struct.pack("<II", 0, len(found)) + found
            case Service.WRITE:
                group, offset, size = _numbers("<III", data)
                self._write(group, offset, _rest(data, 12, size))
                return bytes(4)
            case Service.READ_WRITE:
                group, offset, size, written = _numbers("<IIII", data)
                self._write(group, offset, _rest(data, 16, written))
                found = self._read(group, offset, size)
                return struct.pack("<II", 0, len(found)) + found
            case Service.CONTROL:
                ads_state, device_state, size = _numbers("<HHI", data)
                _rest(data, 8, size)
                self._states = (ads_state, device_state)
                return bytes(4)
            case Service.ADD:
                return self._added(head, data)
            case Service.DELETE:
                self._deleted(_numbers("<I", data)[0])
                return bytes(4)
        raise Refusal(NO_SERVICE)

    def _added(self, head: Head, data: bytes) -> bytes:
        group, offset, size, mode, _delay, cycle = _numbers("<6I", data)
        if len(data) != 40:
            raise Refusal(BAD_SIZE)
        self._read(group, offset, size)  # refuses what does not exist
        message = head.answer(command=8, flags=ADS_COMMAND, invoke_id=0)
        code, handle = self._notifications.add(message, (group, offset, size), mode, cycle)
        if code:
            raise Refusal(code)
        return struct.pack("<II", 0, handle)

    def _deleted(self, handle: int) -> None:
        code = self._notifications.delete(handle)
        if code:
            raise Refusal(code)

    def _read(self, group: int, offset: int, size: int) -> bytes:
        if group == OBJECTS and self._options.objects:
            return self._object(offset)[:size]
        area = self._area(group)
        if offset > len(area):
            raise Refusal(NO_OFFSET)
        if offset + size > len(area):
            raise Refusal(BAD_SIZE)
        return bytes(area[offset : offset + size])

    def _write(self, group: int, offset: int, data: bytes) -> None:
        if group == OBJECTS and self._options.objects:
            self._write_object(offset, data)
            return
        area = self._area(group)
        if group in self._options.read_only:
            raise Refusal(NO_ACCESS)
        if offset > len(area):
            raise Refusal(NO_OFFSET)
        if offset + len(data) > len(area):
            raise Refusal(BAD_SIZE)
        area[offset : offset + len(data)] = data

    def _area(self, group: int) -> bytearray:
        found = self._areas.get(group)
        if found is None:
            raise Refusal(NO_GROUP)
        return found

    def _object(self, offset: int) -> bytes:
        index, subindex = offset >> 16, offset & 0xFF
        try:
            if offset & COMPLETE:
                return self._around.dictionary.read_complete(index, subindex)
            return self._around.dictionary.read(index, subindex)
        except Abort as abort:
            raise Refusal(ABORTS.get(abort.code, DEVICE_ERROR)) from None

    def _write_object(self, offset: int, data: bytes) -> None:
        index, subindex = offset >> 16, offset & 0xFF
        try:
            if offset & COMPLETE:
                self._around.dictionary.write_complete(index, subindex, data)
            else:
                self._around.dictionary.write(index, subindex, data)
        except Abort as abort:
            raise Refusal(ABORTS.get(abort.code, DEVICE_ERROR)) from None


def _numbers(layout: str, data: bytes) -> tuple[int, ...]:
    if len(data) < struct.calcsize(layout):
        raise Refusal(BAD_SIZE)
    return struct.unpack_from(layout, data)


def _rest(data: bytes, start: int, size: int) -> bytes:
    if len(data) - start != size:
        raise Refusal(BAD_SIZE)
    return data[start:]
