"""A segment for tests of the gateway, in virtual time."""

from __future__ import annotations

from typing import Self

import catenary as cat
from catenary.virtual import Coupler, DeviceFiles, Segment, Servo
from tests.gateway.tool import Tool

CONTENT = bytes(k * 7 & 0xFF for k in range(1500))
COUNTS = 2**20


class Line:
    """A coupler and two servos with files, and the MainDevice."""

    gateway: cat.Gateway

    def __init__(self) -> None:
        files = DeviceFiles(contents={"log": CONTENT})
        self.servos = [Servo(files=files), Servo(files=files)]
        self.segment = Segment([Coupler(), *self.servos])
        self.main = cat.MainDevice(self.segment)

    def __enter__(self) -> Self:
        self.main.open()
        self.main.scan()
        return self

    def __exit__(self, *_: object) -> None:
        self.main.close()

    def tool(self, *, udp: bool = False, address: int = 0x1002) -> Tool:
        return Tool(self.gateway.port, udp=udp, address=address)

    def arm(self) -> cat.Drives:
        return cat.Drives(self.main.subs.drives, counts_per_turn=COUNTS, velocity_limit=100.0)

    @property
    def writes(self) -> list[cat.events.GatewayWrite]:
        found = list(self.main.events)
        return [event for event in found if isinstance(event, cat.events.GatewayWrite)]
