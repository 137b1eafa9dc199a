"""Digital output terminal without a mailbox: 1 to 16 outputs, each mapped as one bit.

The outputs are active only in OP, and turn off when the process data watchdog expires. They switch
with the frame. With a clock and an active SYNC unit, they switch with SYNC0.
"""

from __future__ import annotations

from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description, MappedEntry, Pdo, SyncManagerDefault
from catenary.virtual.devices.device import Device
from catenary.virtual.scheduler import Scheduler

BOOLEAN = 1
ACTIVATION, SYNC0_ACTIVE = 0x0981, 0x03


class DigitalOutputs(Device):
    """Terminal with 1 to 16 digital outputs. With `dc`, it has a clock and 1 to 8 outputs."""

    kind = "digital_outputs"

    def __init__(
        self,
        *,
        bits: int = 4,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
        dc: bool = False,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
    ) -> None:
        if not 1 <= bits <= 16:
            raise ValueError(f"bits must be 1 to 16, not {bits}")
        if dc and bits > 8:
            raise ValueError(f"bits must be 1 to 8 with dc=True, not {bits}")
        super().__init__(
            name=name or f"Catenary virtual {bits}-channel output",
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
        )
        self.bits = bits
        self.dc = dc

    def description(self) -> Description:
        # Real terminals have one SyncManager for each byte.
        managers = tuple(
            SyncManagerDefault(0x1000 + 16 * k, 1, 0x44, 0x09, 3)
            for k in range((self.bits + 7) // 8)
        )
        channels = tuple(
            Pdo(
                0x1600 + k,
                f"Channel {k + 1}",
                (MappedEntry(0x7000 + 0x10 * k, 1, 1, "Output", BOOLEAN),),
                k // 8,
            )
            for k in range(self.bits)
        )
        return Description(
            name=self.name,
            order=f"CVO{self.bits:03d}",
            group="Digital outputs",
            product_code=0x0002_0000 + self.bits,
            serial=self.serial,
            alias=self.alias,
            emulation=True,
            pdi_type=0x04,
            mailbox=None,
            sync_managers=managers,
            fmmus=(1,) * len(managers),
            rx_pdos=channels,
            tx_pdos=(),
            clock=self.dc,
            ram=0x0400,
            slots=int(self.dc),
            current_milliampere=100,
            lrw=self.lrw,
        )

    def started(self, scheduler: Scheduler) -> None:
        if self.dc:
            self.core.map_process_data(self.position, True, 0, [(0, self.bits, 0, False)])

    @property
    def outputs(self) -> int:
        """Output levels; bit 0 is channel 1. 0 while the outputs are off."""
        if not self.core.outputs_valid(self.position):
            return 0
        if self._by_sync0:
            return self.core.slot(self.position, 0)
        value = 0
        for k in range((self.bits + 7) // 8):
            value |= int.from_bytes(self.core.output_image(self.position, k), "little") << 8 * k
        return value & ((1 << self.bits) - 1)

    @property
    def _by_sync0(self) -> bool:
        activation = self.core.peek(self.position, ACTIVATION, 1)[0]
        return self.dc and activation & SYNC0_ACTIVE == SYNC0_ACTIVE
