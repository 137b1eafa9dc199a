"""One end of a simplified safety connection: sequence numbers, CRCs, watchdog.

Theory of operation. The states, commands and the layout of the frames are those of FSoE. The inputs
of the CRC are simplified, and there is no unique device ID. Both ends exchange frames in turn:
the SubInstance answers every new frame of the MainInstance, and the answer permits the next frame.
The CRC of a frame covers the CRC_0 that its sender received last, the connection ID, the sequence
number, the command, and the number of the block. A frame that repeats the last one is not new. A
new frame with another CRC, connection ID or command than expected resets the connection. So does
the watchdog, which every new frame restarts. Safe data is zero in every state except DATA.
"""

from __future__ import annotations

from enum import IntEnum

from catenary.errors import DecodeError
from catenary.wire.fsoe import (
    OVERHEAD,
    PAIR,
    SINGLE,
    FsoeCommand,
    SafetyPdu,
    blocks,
    decode,
    encode,
    safety_crc,
)

SEQUENCE_MAX = 0xFFFF


class SafetyState(IntEnum):
    """States of a connection, in the order of its start-up."""

    RESET = 0
    SESSION = 1
    CONNECTION = 2
    PARAMETER = 3
    DATA = 4


class SafetyFault(Exception):
    """Reason to reset a connection. Raised and handled inside of this package."""


class Endpoint:
    """Numbers of one end of a connection, its frame to send, and its watchdog."""

    def __init__(self, size: int) -> None:
        self.size = size  # safety data in a frame [bytes]
        self.connection_id = 0
        self.sent = bytes(SINGLE if size == 1 else OVERHEAD + size // 2 * PAIR)
        self._received = b""  # last frame of the partner
        self._deadline_ns = 0
        self.restart()

    def restart(self) -> None:
        """Begin a new sequence. The next frame of the partner is new, even if it is the same."""
        self.connection_id = 0
        self._sent_number = self._received_number = 0
        self._sent_crc = self._received_crc = 0
        self._received = b""

    def is_new(self, frame: bytes) -> bool:
        """Return True if a frame differs from the last one. It becomes the last one."""
        changed = frame != self._received
        self._received = frame
        return changed

    def send(self, command: FsoeCommand, data: bytes) -> None:
        """Set the frame to send. Data is filled up with zeros."""
        self._sent_number = self._sent_number % SEQUENCE_MAX + 1
        data = data.ljust(self.size, b"\0")
        crcs = self._crcs(self._received_crc, self._sent_number, command, data)
        self._sent_crc = crcs[0]
        self.sent = encode(SafetyPdu(command, data, crcs, self.connection_id))

    def receive(self, frame: bytes) -> SafetyPdu:
        """Return the parts of a new frame.

        Raises:
            SafetyFault: CRC, connection ID or size are not those that are expected.
        """
        try:
            pdu = decode(frame)
        except DecodeError as error:
            raise SafetyFault(str(error)) from None
        number = self._received_number % SEQUENCE_MAX + 1
        if len(pdu.data) != self.size or pdu.connection_id != self.connection_id:
            raise SafetyFault(f"connection ID {pdu.connection_id}, not {self.connection_id}")
        if pdu.crcs != self._crcs(self._sent_crc, number, pdu.command, pdu.data):
            raise SafetyFault("CRC")
        self._received_number = number
        self._received_crc = pdu.crcs[0]
        return pdu

    def _crcs(self, last: int, number: int, command: int, data: bytes) -> tuple[int, ...]:
        return tuple(
            safety_crc((last, self.connection_id, number, command, rank), block)
            for rank, block in enumerate(blocks(data))
        )

    def feed(self, now_ns: int, watchdog_ns: int) -> None:
        """Restart the watchdog."""
        self._deadline_ns = now_ns + watchdog_ns

    def check(self, now_ns: int) -> None:
        """Raise SafetyFault if the watchdog has expired."""
        if now_ns >= self._deadline_ns:
            raise SafetyFault("watchdog")
