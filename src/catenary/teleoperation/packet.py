"""Packets of a teleoperation link: bytes ↔ frozen values, without I/O.

All numbers are little-endian. A link with n axes has packets of one size: 72 + 24 n bytes.

    offset  size  field
    0       4     b"CTEL"
    4       1     version
    5       1     number of axes n, 1 to 16
    6       2     flags: holding 1, in contact 2, wants stop 4, leaving 8
    8       8     session: random number of the sender, new at each start
    16      8     answers: session of the receiver that the sender knows; 0: none
    24      8     sequence number of the session, from 1
    32      8     time of sending [ns], on the monotonic clock of the sender
    40      8     echo: last time of sending that the sender has received [ns]
    48      8     hold time of the echo, from its reception to this packet [ns]
    56      24 n  positions, velocities and forces, float64
    56+24n  16    keyed digest of all bytes before it: BLAKE2b (RFC 7693), truncated by its own
                  parameter

The digest shows that a holder of the key made the packet, and that no byte changed. The contents
are not encrypted: every device on the path can read them.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from typing import NamedTuple

from catenary.teleoperation.refusal import Refusal
from catenary.teleoperation.sample import AXES_MAX, PeerSample, check_sample

MAGIC, VERSION = b"CTEL", 1
HEADER = struct.Struct("<4sBBHQQQqqq")
DIGEST_BYTES = 16
SIZE_MAX = HEADER.size + 24 * AXES_MAX + DIGEST_BYTES
HOLDING, IN_CONTACT, WANTS_STOP, LEAVING = 1, 2, 4, 8  # flags
PERSON = b"catenary-teleop1"  # separates these digests from other uses of the key
KEY_BYTES = 32


class Packet(NamedTuple):
    """One packet. Times are in ns."""

    session: int
    answers: int
    sequence: int
    sent_ns: int
    echo_ns: int
    hold_ns: int
    sample: PeerSample
    leaving: bool = False  # True for the last packet of a program that ends


class Codec:
    """Encoder and decoder of the packets of one link.

    Args:
        key: secret key of 32 bytes, the same on both sides.
        axes: number of axes, 1 to 16.

    Raises:
        ValueError: the key has another length, or `axes` is out of range.
    """

    def __init__(self, key: bytes, axes: int) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"a key has {KEY_BYTES} bytes, not {len(key)}; make one with make_key")
        if not 1 <= axes <= AXES_MAX:
            raise ValueError(f"{axes} axes: a packet holds 1 to {AXES_MAX}")
        self.axes = axes
        self._numbers = struct.Struct(f"<{3 * axes}d")
        self._end = HEADER.size + self._numbers.size
        self._keyed = hashlib.blake2b(key=key, digest_size=DIGEST_BYTES, person=PERSON)

    @property
    def size(self) -> int:
        """Size of each packet of this link [bytes]."""
        return self._end + DIGEST_BYTES

    def encode(self, packet: Packet) -> bytes:
        """Return the bytes of a packet. Raises ValueError if the sample is invalid."""
        sample = packet.sample
        check_sample(sample, self.axes)
        flags = HOLDING * bool(sample.holding) | IN_CONTACT * bool(sample.in_contact)
        flags |= WANTS_STOP * bool(sample.wants_stop) | LEAVING * packet.leaving
        data = HEADER.pack(MAGIC, VERSION, self.axes, flags, *packet[:6])
        data += self._numbers.pack(*sample.position, *sample.velocity, *sample.force)
        return data + self._digest(data)

    def decode(self, data: bytes) -> Packet | Refusal:
        """Return the packet in a datagram, or the reason why it is not used."""
        if len(data) < HEADER.size + DIGEST_BYTES or data[:4] != MAGIC:
            return Refusal.FORMAT
        if data[4] != VERSION:
            return Refusal.VERSION
        if not hmac.compare_digest(self._digest(data[:-DIGEST_BYTES]), data[-DIGEST_BYTES:]):
            return Refusal.KEY
        if data[5] != self.axes:
            return Refusal.AXES
        if len(data) != self.size:
            return Refusal.FORMAT
        return self._packet(data)

    def _packet(self, data: bytes) -> Packet | Refusal:
        _magic, _version, n, flags, session, answers, sequence, *times = HEADER.unpack_from(data)
        values = self._numbers.unpack_from(data, HEADER.size)
        sample = PeerSample(
            values[:n],
            values[n : 2 * n],
            values[2 * n :],
            bool(flags & HOLDING),
            bool(flags & IN_CONTACT),
            bool(flags & WANTS_STOP),
        )
        if not sample.is_finite:
            return Refusal.NOT_FINITE
        sent, echo, hold = times
        leaving = bool(flags & LEAVING)
        return Packet(session, answers, sequence, sent, echo, hold, sample, leaving)

    def _digest(self, data: bytes) -> bytes:
        state = self._keyed.copy()
        state.update(data)
        return state.digest()
