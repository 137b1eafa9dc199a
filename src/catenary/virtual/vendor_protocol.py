"""Vendor-specific protocol (VoE) of a virtual device, ETG.1000.6 §5.10."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Literal, TypeAlias

import msgspec

from catenary.virtual.mailbox import ERROR_TOO_SHORT
from catenary.virtual.protocols import Surroundings

HEADER = struct.Struct("<IH")  # vendor, type
VOE_PROTOCOL = 15
FLOOD = 40  # copies of an answer

# Receives the vendor, the type and the data; returns the type and data of the answer, or None.
VendorAnswer: TypeAlias = Callable[[int, int, bytes], tuple[int, bytes] | None]


class VendorServer:
    """Device side of VoE: each message is answered by a function."""

    def __init__(self, answer: VendorAnswer, surroundings: Surroundings, copies: int = 1) -> None:
        self._answer = answer
        self._around = surroundings
        self._copies = copies

    def reset(self) -> None:
        """Discard nothing: messages are independent."""

    def serve(self, payload: bytes) -> list[bytes] | int:
        """Return the answer to a message, or the code of a mailbox error."""
        if len(payload) < HEADER.size:
            return ERROR_TOO_SHORT
        vendor, kind = HEADER.unpack_from(payload)
        answer = self._answer(vendor, kind, payload[HEADER.size :])
        if answer is None:
            return []
        message = HEADER.pack(vendor, answer[0]) + answer[1]
        return [message[: self._around.send_room]] * self._copies

    def send(self, vendor: int, type: int, data: bytes) -> bool:
        """Send a message that was not requested. Return False if too many messages wait."""
        return self._around.mailbox.send(VOE_PROTOCOL, HEADER.pack(vendor, type) + data)


class VendorMessages:
    """VoE of a virtual device. A function computes the answers.

    Example: `Servo(protocols=[VendorMessages(lambda vendor, type, data: (type, data[::-1]))])`.
    """

    def __init__(self, answer: VendorAnswer) -> None:
        """Initialise the protocol.

        Args:
            answer: Function that receives the vendor, the type and the data of a message. It
                returns the type and the data of the answer; None: no answer.
        """
        self._answer = answer
        self._server: VendorServer | None = None

    @property
    def number(self) -> int:
        """Type of VoE in the mailbox header."""
        return VOE_PROTOCOL

    def start(self, surroundings: Surroundings) -> VendorServer:
        """Make the server. Called at each start of the device."""
        self._server = VendorServer(self._answer, surroundings)
        return self._server

    def send(self, vendor: int, type: int, data: bytes = b"") -> bool:
        """Send a message that was not requested.

        Args:
            vendor: Vendor ID.
            type: Vendor type.
            data: The data.

        Returns:
            False if the message was dropped, because 16 messages are waiting.

        Raises:
            ValueError: The device is not in a segment.
        """
        if self._server is None:
            raise ValueError("the device is not in a segment; add it with Segment([...])")
        return self._server.send(vendor, type, data)


class VendorEcho(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """VoE of a virtual device that answers each message with the same type and data.

    In TOML: `vendor_echo = {}`.
    """

    # Answers to a message. "none": no answer. "flood": 40 equal answers. No device with "flood" has
    # been reported.
    answers: Literal["one", "none", "flood"] = "one"

    @property
    def number(self) -> int:
        """Type of VoE in the mailbox header."""
        return VOE_PROTOCOL

    def start(self, surroundings: Surroundings) -> VendorServer:
        """Make the server. Called at each start of the device."""
        copies = FLOOD if self.answers == "flood" else 1
        return VendorServer(self._echo, surroundings, copies)

    def _echo(self, vendor: int, type: int, data: bytes) -> tuple[int, bytes] | None:
        return None if self.answers == "none" else (type, data)
