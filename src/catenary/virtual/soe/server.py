"""Server of SoE, ETG.1000.6 §5.9: elements of IDNs, fragments in both directions.

The code is independent of the codec `catenary.wire.soe`, so that each tests the other.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from catenary.virtual.mailbox import ERROR_TOO_SHORT
from catenary.virtual.protocols import Surroundings
from catenary.virtual.soe.parameter import (
    LIST_MAX,
    NO_IDN,
    READ_ONLY,
    TOO_LONG,
    Parameter,
    Refusal,
    idn,
)
from catenary.virtual.soe.quirks import SoeQuirks

HEADER = struct.Struct("<BBH")
READ_REQUEST, READ_RESPONSE, WRITE_REQUEST, WRITE_RESPONSE, NOTIFICATION, EMERGENCY = range(1, 7)
INCOMPLETE, ERROR = 0x08, 0x10
STATE, NAME, ATTRIBUTE, UNIT, MINIMUM, MAXIMUM, VALUE, DEFAULT = (1 << bit for bit in range(8))
NO_NAME, NO_UNIT, NO_MINIMUM, NO_MAXIMUM, NO_STATE, NO_DEFAULT = (
    *(0x2001, 0x4001, 0x5001, 0x6001, 0x7014, 0x8001),
)
NO_DRIVE, GENERAL_ERROR, NO_ELEMENT = 0x800A, 0x800B, 0x800C
CANNOT_CHANGE = {NAME: 0x2004, ATTRIBUTE: 0x3004, UNIT: 0x4004, MINIMUM: 0x5004, MAXIMUM: 0x6004}


class SoeServer:
    """Answers of one device. `parameters` are the IDNs of drive 0."""

    def __init__(
        self,
        parameters: Mapping[int, Parameter],
        surroundings: Surroundings,
        quirks: SoeQuirks,
        write_command: Callable[[Parameter, bytes], None],
    ) -> None:
        """Initialise the server.

        Args:
            parameters: IDNs of the drive.
            surroundings: Mailbox and state of the device.
            quirks: Differences from the standard.
            write_command: Function that sets the value of a procedure command.
        """
        self._parameters = parameters
        self._surroundings = surroundings
        self._quirks = quirks
        self._write_command = write_command
        self._refused = {idn(each): code for each, code in quirks.refused.items()}
        self._lying = {idn(each) for each in quirks.lying_lists}
        self.reset()

    def reset(self) -> None:
        """Forget a write. Called on entry to PRE-OP."""
        self._received = bytearray()
        self._left: int | None = None  # number in the last fragment of a write; None: no write

    def serve(self, payload: bytes) -> list[bytes] | int:
        """Return the answers to a message, or the code of a mailbox error."""
        if len(payload) < HEADER.size:
            return ERROR_TOO_SHORT
        flags, elements, number = HEADER.unpack_from(payload)
        data, drive = payload[HEADER.size :], flags >> 5
        if flags & 0x07 == READ_REQUEST:
            self.reset()  # the rest of a write does not arrive
            return self._answer_read(drive, elements, number)
        if flags & 0x07 == WRITE_REQUEST:
            return self._answer_write(drive, elements, number, data, bool(flags & INCOMPLETE))
        return []

    def _answer_read(self, drive: int, elements: int, number: int) -> list[bytes]:
        try:
            parameter = self._parameter(drive, number)
            if elements & elements - 1 and self._quirks.one_element:
                raise Refusal(GENERAL_ERROR)
            data = self._read(parameter, elements)
        except Refusal as refusal:
            return [_error(READ_RESPONSE, drive, elements, number, refusal.code)]
        room = self._surroundings.send_room - HEADER.size
        step = min(self._quirks.fragment_bytes or room, room)
        parts = [data[at : at + step] for at in range(0, len(data), step)] or [b""]
        return [
            self._fragment(drive, elements, number, part, len(parts) - 1 - k)
            for k, part in enumerate(parts)
        ]

    def _fragment(self, drive: int, elements: int, number: int, part: bytes, left: int) -> bytes:
        flags = READ_RESPONSE | (INCOMPLETE if left else 0) | drive << 5
        counted = left and not self._quirks.constant_fragments
        return HEADER.pack(flags, elements, left if counted else number) + part

    def _parameter(self, drive: int, number: int) -> Parameter:
        if drive:
            raise Refusal(NO_DRIVE)
        if number in self._refused:
            raise Refusal(self._refused[number])
        found = self._parameters.get(number)
        if found is None:
            raise Refusal(NO_IDN)
        return found

    def _read(self, parameter: Parameter, elements: int) -> bytes:
        if not elements:
            raise Refusal(NO_ELEMENT)
        readers: dict[int, Callable[[], bytes]] = {
            STATE: lambda: self._state(parameter),
            NAME: lambda: _list(parameter.name, NO_NAME),
            ATTRIBUTE: lambda: parameter.attribute,
            UNIT: lambda: _list(parameter.unit, NO_UNIT),
            MINIMUM: lambda: _number(parameter, parameter.minimum, NO_MINIMUM),
            MAXIMUM: lambda: _number(parameter, parameter.maximum, NO_MAXIMUM),
            VALUE: lambda: self._value(parameter),
            DEFAULT: lambda: _number(parameter, parameter.default, NO_DEFAULT),
        }
        return b"".join(read() for element, read in readers.items() if elements & element)

    def _state(self, parameter: Parameter) -> bytes:
        if not parameter.is_command:
            raise Refusal(NO_STATE)
        return struct.pack("<H", parameter.state)

    def _value(self, parameter: Parameter) -> bytes:
        value = parameter.value()
        if parameter.number not in self._lying:
            return value
        length, limit = struct.unpack_from("<HH", value)
        return struct.pack("<HH", 2 * length + 2, max(limit, 2 * length + 2)) + value[4:]

    def _answer_write(
        self, drive: int, elements: int, number: int, data: bytes, incomplete: bool
    ) -> list[bytes]:
        if incomplete:
            return self._take_fragment(drive, elements, number, data)
        whole = bytes(self._received) + data
        self.reset()
        try:
            parameter = self._parameter(drive, number)
            self._write(parameter, elements, whole)
        except Refusal as refusal:
            return [_error(WRITE_RESPONSE, drive, elements, number, refusal.code)]
        return [HEADER.pack(WRITE_RESPONSE | drive << 5, elements, number)]

    def _take_fragment(self, drive: int, elements: int, left: int, data: bytes) -> list[bytes]:
        """Store a fragment. A fragment that was repeated after a lost frame is dropped.

        A fragment with any other number than the next one starts a new write.
        """
        if left == self._left:
            return []
        if self._left is not None and left != self._left - 1:
            self.reset()
        self._left = left
        self._received += data
        if len(self._received) > LIST_MAX + 4:
            self.reset()
            return [_error(WRITE_RESPONSE, drive, elements, left, TOO_LONG)]
        return []

    def _write(self, parameter: Parameter, elements: int, data: bytes) -> None:
        if elements != VALUE:
            raise Refusal(CANNOT_CHANGE.get(elements, READ_ONLY if elements else NO_ELEMENT))
        if parameter.is_command:
            self._write_command(parameter, data)
        else:
            parameter.write(data, self._surroundings.state())


def _error(service: int, drive: int, elements: int, number: int, code: int) -> bytes:
    return HEADER.pack(service | ERROR | drive << 5, elements, number) + struct.pack("<H", code)


def _list(content: str, missing: int) -> bytes:
    if not content:
        raise Refusal(missing)
    data = content.encode("latin-1", "replace")
    return struct.pack("<HH", len(data), len(data)) + data


def _number(parameter: Parameter, number: int | None, missing: int) -> bytes:
    if number is None:
        raise Refusal(missing)
    return parameter.encode(number)
