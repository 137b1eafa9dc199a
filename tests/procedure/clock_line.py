"""A simulated line of clocks with the registers of the time loop."""

from __future__ import annotations

from dataclasses import dataclass, field

from catenary.model.delays import PROCESSING_NS
from catenary.model.device import DeviceDescription, Identity
from catenary.procedure.exchange import Reply, Request
from catenary.wire.datagram import EcatCommand
from catenary.wire.features import Feature, Information, PortKind

STATION = 0x1001
CABLE_NS = 300  # including forwarding
HOP_NS = CABLE_NS + PROCESSING_NS
NONE, STAMPS, SHORT, LONG = "none", "stamps", "short", "long"  # kinds of clocks
FEATURES = {
    NONE: Feature(0),
    STAMPS: Feature.DISTRIBUTED_CLOCKS | Feature.DISTRIBUTED_CLOCKS_64_BIT,
    SHORT: Feature.DISTRIBUTED_CLOCKS,
    LONG: Feature.DISTRIBUTED_CLOCKS | Feature.DISTRIBUTED_CLOCKS_64_BIT,
}


@dataclass
class ClockModel:
    """One device. When a frame arrives, its local time is the time of the master plus `zero`."""

    kind: str
    zero: int = 0
    registers: bytearray = field(default_factory=lambda: bytearray(0x1000))
    written: list[tuple[int, bytes]] = field(default_factory=list)

    @property
    def offset(self) -> int:
        return int.from_bytes(self.registers[0x920:0x928], "little")

    @property
    def delay(self) -> int:
        return int.from_bytes(self.registers[0x928:0x92C], "little")


class ClockLine:
    """Devices on a line that answer datagrams. Each datagram advances `now` by a microsecond."""

    def __init__(self, *clocks: ClockModel) -> None:
        self.clocks = clocks
        self.now = 5_000_000_000  # more than 32 bits can hold
        self.dead: set[int] = set()  # positions that do not answer

    def descriptions(self) -> list[DeviceDescription]:
        count = len(self.clocks)
        return [
            DeviceDescription(
                position=position,
                station_address=STATION + position,
                alias=0,
                identity=Identity(1, 2, 3, position),
                name=f"Clock {position}",
                controller=Information(
                    *(0x11, 0, 0, 8, 8, 8), (PortKind.MII,) * 4, FEATURES[clock.kind]
                ),
                mailbox=None,
                sync_managers=(),
                outputs=(),
                inputs=(),
                output_pdos=(),
                input_pdos=(),
                open_ports=(True, position + 1 < count, False, False),
                parent=position - 1 if position else None,
                parent_port=1 if position else None,
                system_time=clock.kind in (SHORT, LONG),
            )
            for position, clock in enumerate(self.clocks)
        ]

    def __call__(self, request: Request) -> Reply:
        self.now += 1000
        address, station = request.address >> 16, request.address & 0xFFFF
        if request.command is EcatCommand.BWR:
            return self._broadcast(address, request)
        position = station - STATION
        clock = self.clocks[position]
        if position in self.dead or not self._has(clock, address):
            return Reply(request.data, 0)
        if request.command is EcatCommand.FPWR:
            size = len(request.data)
            if clock.kind == SHORT and size == 8 and address in (0x920, 0x990):
                return Reply(request.data, 0)
            clock.registers[address : address + size] = request.data
            clock.written.append((address, request.data))
            return Reply(request.data, 1)
        self._refresh(position, clock)
        data = bytes(clock.registers[address : address + len(request.data)])
        return Reply(data, 1)

    def _has(self, clock: ClockModel, address: int) -> bool:
        if clock.kind == NONE:
            return False
        if clock.kind == STAMPS:
            return 0x900 <= address < 0x910
        return not (clock.kind == SHORT and address == 0x918)

    def _broadcast(self, address: int, request: Request) -> Reply:
        if address == 0x900:
            for position, clock in enumerate(self.clocks):
                self._latch(position, clock)
        for clock in self.clocks:
            if clock.kind != NONE:
                clock.written.append((address, request.data))
        return Reply(request.data, sum(clock.kind != NONE for clock in self.clocks))

    def _latch(self, position: int, clock: ClockModel) -> None:
        local = self.now + HOP_NS * position + clock.zero
        behind = len(self.clocks) - 1 - position
        back = local + behind * (HOP_NS + CABLE_NS) + PROCESSING_NS
        clock.registers[0x900:0x904] = (local % 2**32).to_bytes(4, "little")
        clock.registers[0x904:0x908] = (back % 2**32).to_bytes(4, "little")
        clock.registers[0x918:0x920] = local.to_bytes(8, "little")

    def _refresh(self, position: int, clock: ClockModel) -> None:
        """Set 0x0910 to the time at which the frame passed the reference clock."""
        system = self.now + HOP_NS * position + clock.zero + clock.offset - clock.delay
        clock.registers[0x910:0x918] = (system % 2**64).to_bytes(8, "little")
