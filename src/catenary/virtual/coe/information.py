"""SDO information services, ETG.1000.6 §5.6.3: object list, object and entry descriptions."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from catenary.virtual.coe.dictionary import (
    MAP_RX,
    MAP_TX,
    NO_OBJECT,
    NO_SUBINDEX,
    UNKNOWN_COMMAND,
    Dictionary,
)
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks

SDO_INFORMATION = 8
LIST_REQUEST, LIST, OBJECT_REQUEST, OBJECT, ENTRY_REQUEST, ENTRY, ERROR = range(1, 8)
INCOMPLETE = 0x80
HEADER = 2 + 4
ABORT_SIZE = 4


def _message(opcode: int, payload: bytes, left: int = 0) -> bytes:
    flags = opcode | (INCOMPLETE if left else 0)
    return struct.pack("<HBxH", SDO_INFORMATION << 12, flags, left) + payload


class InformationServer:
    """Server of SDO information requests for one dictionary.

    `size`: mailbox size without its header [bytes]. `supported`: False refuses all requests.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        *,
        size: int,
        supported: bool = True,
        quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
    ) -> None:
        self._dictionary = dictionary
        self._supported = supported
        self._quirks = quirks
        self._room = (size - HEADER) & ~1

    def serve(self, payload: bytes) -> Iterable[bytes]:
        opcode = payload[0] & 0x7F if payload and self._supported else 0
        body = payload[4:]
        if opcode == LIST_REQUEST and len(body) >= 2:
            return self._lists(struct.unpack_from("<H", body)[0])
        if opcode == OBJECT_REQUEST and len(body) >= 2:
            return self._objects(struct.unpack_from("<H", body)[0])
        if opcode == ENTRY_REQUEST and len(body) >= 4:
            return [self._entry(*struct.unpack_from("<HBB", body))]
        return [self._error(UNKNOWN_COMMAND)]

    def _error(self, code: int) -> bytes:
        counted = 0 if self._quirks.uncounted_aborts else ABORT_SIZE
        return _message(ERROR, struct.pack("<I", code)[:counted])

    def _described(self, opcode: int, head: bytes, name: str) -> bytes:
        """Return a description. Truncate a name that does not fit into the mailbox."""
        text = (self._quirks.text_prefix + name).encode("latin-1", "replace")
        return _message(opcode, (head + text)[: self._room])

    def _indices(self, kind: int) -> list[int]:
        objects = list(self._dictionary.objects.values())
        if kind in (2, 3):
            flag = MAP_RX if kind == 2 else MAP_TX
            objects = [o for o in objects if any(e.access & flag for e in o.entries.values())]
        elif kind in (4, 5):
            objects = []
        return sorted(o.index for o in objects)

    def _lists(self, kind: int) -> list[bytes]:
        if kind == 0:
            content = struct.pack("<5H", *(len(self._indices(k)) for k in range(1, 6)))
        elif kind > 5:
            return [self._error(UNKNOWN_COMMAND)]
        else:
            indices = self._indices(kind)
            content = struct.pack(f"<{len(indices)}H", *indices)
        content = struct.pack("<H", kind) + content
        parts = [content[k : k + self._room] for k in range(0, len(content), self._room)]
        if kind and self._quirks.object_list == "missing":
            parts = parts[: max(len(parts) - 1, 1)]
        messages = [_message(LIST, part, len(parts) - 1 - k) for k, part in enumerate(parts)]
        promised = kind and self._quirks.object_list == "promised"
        return messages[: max(len(messages) - 1, 1)] if promised else messages

    def _objects(self, index: int) -> list[bytes]:
        if index in self._quirks.missing_descriptions:
            return []
        if index in self._quirks.malformed_descriptions:
            return [_message(OBJECT, struct.pack("<H", index))]
        return [self._object(index)]

    def _object(self, index: int) -> bytes:
        found = self._dictionary.objects.get(index)
        if found is None or not found.described:
            return self._error(NO_OBJECT)
        head = struct.pack("<HHBB", index, found.data_type, found.highest, found.code)
        return self._described(OBJECT, head, found.name)

    def _entry(self, index: int, subindex: int, information: int) -> bytes:
        found = self._dictionary.objects.get(index)
        if found is None or not found.described:
            return self._error(NO_OBJECT)
        if subindex not in found.entries:
            return self._error(NO_SUBINDEX)
        entry = found.entries[subindex]
        head = struct.pack(
            "<HBBHHH", index, subindex, information & 0, entry.data_type, entry.bits, entry.access
        )
        return self._described(ENTRY, head, entry.name)
