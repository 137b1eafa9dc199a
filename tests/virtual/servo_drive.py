"""Cyclic exchange with one virtual servo by single datagrams, for tests of the drive alone."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from catenary.virtual import Segment, Servo
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import MILLISECOND, STATION, MainDevice

CSP, CSV, CST = 8, 9, 10
TURN = 1 << 20  # counts of the default servo
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP = 0x06, 0x07, 0x0F, 0x02
STATE_MASK = 0x6F


@dataclass
class Inputs:
    status: int
    mode: int
    velocity: int
    position: int
    torque: int


class Drive:
    """Cyclic exchange with one servo in OP, the first device of `segment`; None: a new segment."""

    def __init__(
        self, servo: Servo, *, control: int = 0x64, segment: Segment | None = None
    ) -> None:
        self.servo = servo
        self.main = MainDevice(segment or Segment([servo]))
        self.main.number_stations()
        self.main.let_pass(30)
        self.main.start_servo(STATION, 0, control=control)
        self.word, self.mode, self.velocity, self.position, self.torque = 0, CSP, 0, 0, 0
        self.cycle()
        assert self.main.request(STATION, 8) == (8, 0)

    def cycle(self, count: int = 1) -> Inputs:
        for _ in range(count):
            start = self.main.link.now()
            out = struct.pack(
                "<HbiiH", self.word, self.mode, self.velocity, self.position, self.torque & 0xFFFF
            )
            answer = self.main.exchange_logical(EcatCommand.LRW, 0, out + bytes(13))
            assert answer.working_counter == 3
            self.main.link.wait_until(start + MILLISECOND, False)
        return Inputs(*struct.unpack("<Hbiih", answer.data[13:]))

    def enable(self, mode: int) -> Inputs:
        self.mode = mode
        for self.word in (SHUTDOWN, SWITCH_ON, ENABLE):
            self.position = self.cycle(3).position
        return self.cycle(3)

    def state(self) -> int:
        return self.cycle(2).status & STATE_MASK
