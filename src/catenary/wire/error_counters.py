"""Error counters, registers 0x0300 to 0x0313. Each counter stops at 255; a write clears it.

Source: Beckhoff, ESC data sheet, section I §14 (meaning of the counters) and section II §3.33 to
§3.38 (registers).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from operator import attrgetter

from catenary.errors import DecodeError
from catenary.wire.register import ERROR_COUNTERS, PORT_COUNT

FULL = 255  # the value at which a counter stops
_BLOCK = struct.Struct("<8B4BBBxx4B")


@dataclass(frozen=True, slots=True)
class PortErrors:
    """Error counts of one port."""

    invalid_frames: int = 0  # broken frames detected first at this port: its cable is suspect
    symbol_errors: int = 0  # physical layer errors (RX_ER), also between frames
    forwarded: int = 0  # broken frames that an earlier device has already marked
    lost_links: int = 0

    def __bool__(self) -> bool:
        return bool(self.invalid_frames or self.symbol_errors or self.forwarded or self.lost_links)


_FIELDS = attrgetter("invalid_frames", "symbol_errors", "forwarded", "lost_links")
_NONE = PortErrors()
Ports = tuple[PortErrors, PortErrors, PortErrors, PortErrors]


@dataclass(frozen=True, slots=True)
class ErrorCounters:
    """Error counts of one device since its power-up or the last write."""

    ports: Ports = (_NONE, _NONE, _NONE, _NONE)
    processing_unit: int = 0  # broken or malformed frames that arrived at port 0
    pdi: int = 0  # errors of the interface to the device's processor

    def __bool__(self) -> bool:
        return any(self.ports) or bool(self.processing_unit or self.pdi)

    def encode(self) -> bytes:
        """Return the 20 encoded bytes. Raises ValueError if a counter does not fit."""
        receive = [n for port in self.ports for n in (port.invalid_frames, port.symbol_errors)]
        forwarded = [port.forwarded for port in self.ports]
        lost = [port.lost_links for port in self.ports]
        try:
            return _BLOCK.pack(*receive, *forwarded, self.processing_unit, self.pdi, *lost)
        except struct.error as error:
            raise ValueError(f"error counters: {error}") from None

    def since(self, before: ErrorCounters) -> ErrorCounters:
        """Return the counts since `before`.

        If a counter decreased, return the present counts: all counters have probably restarted.
        """
        if self.restarted(before):
            return self
        one, two, three, four = (
            PortErrors(*(a - b for a, b in zip(_FIELDS(now), _FIELDS(then), strict=True)))
            for now, then in zip(self.ports, before.ports, strict=True)
        )
        return ErrorCounters(
            (one, two, three, four),
            self.processing_unit - before.processing_unit,
            self.pdi - before.pdi,
        )

    def restarted(self, before: ErrorCounters) -> bool:
        """Return True if a counter decreased, which shows a power cycle or cleared counters."""
        return any(a < b for a, b in zip(self.encode(), before.encode(), strict=True))


def decode_error_counters(data: bytes) -> ErrorCounters:
    """Decode the 20 bytes of the counters, from 0x0300 on."""
    if len(data) != ERROR_COUNTERS.size:
        raise DecodeError(f"{ERROR_COUNTERS}: needs {ERROR_COUNTERS.size} bytes, got {len(data)}")
    numbers = _BLOCK.unpack(data)
    receive, forwarded, lost = numbers[:8], numbers[8:12], numbers[14:18]
    one, two, three, four = (
        PortErrors(receive[2 * n], receive[2 * n + 1], forwarded[n], lost[n])
        for n in range(PORT_COUNT)
    )
    return ErrorCounters((one, two, three, four), numbers[12], numbers[13])
