"""Manual configuration of clocks, for tests of the virtual controllers' time."""

from __future__ import annotations

import struct

from catenary.virtual import Segment
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import STATION, MainDevice

RECEIVE_TIMES, UNIT_TIME = 0x0900, 0x0918
SYSTEM_TIME, OFFSET, DELAY, DIFFERENCE = 0x0910, 0x0920, 0x0928, 0x092C
SPEED_START, SPEED_DIFFERENCE, FILTERS = 0x0930, 0x0932, 0x0934
CYCLIC_UNIT, ACTIVATION, PULSE_LENGTH, PENDING = 0x0980, 0x0981, 0x0982, 0x0984
START_TIME, NEXT_SYNC1, SYNC0_CYCLE, SYNC1_CYCLE = 0x0990, 0x0998, 0x09A0, 0x09A4


class Clocks(MainDevice):
    """Link to a segment, with functions that set, read and distribute its clocks."""

    def __init__(self, segment: Segment) -> None:
        super().__init__(segment)
        self.number_stations()

    def number(self, position: int, address: int, form: str) -> int:
        raw = self.read(STATION + position, address, struct.calcsize(form))
        return int(struct.unpack(form, raw)[0])

    def put_number(self, position: int, address: int, form: str, value: int) -> int:
        return self.write(STATION + position, address, struct.pack(form, value))

    def system_time(self, position: int) -> int:
        return self.number(position, SYSTEM_TIME, "<Q")

    def difference(self, position: int) -> int:
        raw = self.number(position, DIFFERENCE, "<I")
        return -(raw & 0x7FFF_FFFF) if raw >> 31 else raw

    def latch(self) -> list[tuple[int, int, int]]:
        """Return the receive times (port 0, port 1, processing unit) of every device [ns]."""
        self.exchange(EcatCommand.BWR, 0, RECEIVE_TIMES, bytes(4))
        times = []
        for k in range(len(self.segment)):
            port0, port1 = struct.unpack("<II", self.read(STATION + k, RECEIVE_TIMES, 8))
            times.append((port0, port1, self.number(k, UNIT_TIME, "<Q")))
        return times

    def align(self, latches: int = 16) -> None:
        """Align a line of 64-bit clocks to the first: delays and offsets from a mean."""
        count = len(self.segment)
        delays, last = [0.0] * count, []
        for _ in range(latches):
            last = self.latch()
            spans = [(port1 - port0) % 2**32 if port1 else 0 for port0, port1, _ in last]
            for k in range(1, count):
                delays[k] += (spans[0] - spans[k]) / 2 / latches
        for k in range(1, count):
            delay = max(0, round(delays[k]))
            offset = last[0][2] - last[k][2] + delay
            self.write(STATION + k, OFFSET, struct.pack("<qI", offset, delay))

    def distribute(self) -> None:
        self.exchange(EcatCommand.FRMW, STATION, SYSTEM_TIME, bytes(4))

    def burst(self, frames: int) -> None:
        for _ in range(frames):
            self.distribute()

    def run(self, milliseconds: int) -> None:
        """Run cycles of 1 ms that only distribute the time."""
        for _ in range(milliseconds):
            start = self.link.now()
            self.distribute()
            self.link.wait_until(start + 1_000_000, False)
