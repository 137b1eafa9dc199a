"""Digital input terminal without a mailbox: 1 to 16 inputs, each mapped as one bit."""

from __future__ import annotations

from catenary.virtual.description import Description, MappedEntry, Pdo, SyncManagerDefault
from catenary.virtual.devices.device import Device
from catenary.virtual.scheduler import Scheduler

BOOLEAN = 1
SAMPLING_NS = 100_000


class DigitalInputs(Device):
    """Terminal with 1 to 16 digital inputs."""

    kind = "digital_inputs"

    def __init__(
        self,
        *,
        bits: int = 4,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
    ) -> None:
        if not 1 <= bits <= 16:
            raise ValueError(f"bits must be 1 to 16, not {bits}")
        super().__init__(
            name=name or f"Catenary virtual {bits}-channel input",
            alias=alias,
            serial=serial,
            lrw=lrw,
        )
        self.bits = bits
        self._inputs = 0

    def description(self) -> Description:
        size = (self.bits + 7) // 8
        channels = tuple(
            Pdo(
                0x1A00 + k,
                f"Channel {k + 1}",
                (MappedEntry(0x6000 + 0x10 * k, 1, 1, "Input", BOOLEAN),),
                0,
            )
            for k in range(self.bits)
        )
        return Description(
            name=self.name,
            order=f"CVI{self.bits:03d}",
            group="Digital inputs",
            product_code=0x0003_0000 + self.bits,
            serial=self.serial,
            alias=self.alias,
            emulation=True,
            pdi_type=0x04,
            mailbox=None,
            sync_managers=(SyncManagerDefault(0x1000, size, 0x00, 0x01, 4),),
            fmmus=(2,),
            rx_pdos=(),
            tx_pdos=channels,
            clock=False,
            ram=0x0400,
            slots=1,
            current_milliampere=90,
            lrw=self.lrw,
        )

    def started(self, scheduler: Scheduler) -> None:
        self.core.map_process_data(self.position, False, 0, [(0, self.bits, 0, False)])
        self.core.run_model(self.position, SAMPLING_NS)

    @property
    def inputs(self) -> int:
        """Input levels; bit 0 is channel 1."""
        return self.core.slot(self.position, 0)

    @inputs.setter
    def inputs(self, value: int) -> None:
        if not 0 <= value < 1 << self.bits:
            raise ValueError(
                f"inputs must be 0 to {(1 << self.bits) - 1} ({self.bits} channels), not {value}"
            )
        self.core.put_slot(self.position, 0, value)
        self.core.refresh_inputs(self.position)
