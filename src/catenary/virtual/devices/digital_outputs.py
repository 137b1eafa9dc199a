"""Digital outputs: a terminal without mailbox, 1 to 16 bits, mapped bit by bit.

Its outputs are on in OP only and fall when the process data watchdog expires.
"""

from __future__ import annotations

from catenary.virtual.description import Description, MappedEntry, Pdo, SyncManagerDefault
from catenary.virtual.devices.device import Device

BOOLEAN = 1


class DigitalOutputs(Device):
    """Owns a terminal of 1 to 16 digital outputs."""

    kind = "digital_outputs"

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
            raise ValueError(f"digital outputs have 1 to 16 bits, not {bits}")
        super().__init__(
            name=name or f"Catenary virtual {bits}-channel output",
            alias=alias,
            serial=serial,
            lrw=lrw,
        )
        self.bits = bits

    def description(self) -> Description:
        # one SyncManager for each byte, as such terminals have
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
            revision=0x0001_0000,
            serial=self.serial,
            alias=self.alias,
            emulation=True,
            pdi_type=0x04,
            mailbox=None,
            sync_managers=managers,
            fmmus=(1,) * len(managers),
            rx_pdos=channels,
            tx_pdos=(),
            clock=False,
            ram=0x0400,
            current_milliampere=100,
        )

    @property
    def outputs(self) -> int:
        """The outputs as they stand at the terminals: bit 0 is channel 1."""
        if not self.core.outputs_valid(self.position):
            return 0
        value = 0
        for k in range((self.bits + 7) // 8):
            value |= int.from_bytes(self.core.output_image(self.position, k), "little") << 8 * k
        return value & ((1 << self.bits) - 1)
