"""Bus coupler without process data or mailbox. Its AL status follows AL control."""

from __future__ import annotations

from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description
from catenary.virtual.devices.device import Device


class Coupler(Device):
    """Bus coupler, to which terminals are attached."""

    kind = "coupler"

    def __init__(
        self,
        *,
        name: str = "Catenary virtual coupler",
        alias: int = 0,
        serial: int = 0,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
    ) -> None:
        super().__init__(
            name=name,
            alias=alias,
            serial=serial,
            lrw=True,
            crystal=crystal,
            clock_bits=clock_bits,
        )

    def description(self) -> Description:
        return Description(
            name=self.name,
            order="CVK100",
            group="Couplers",
            product_code=0x0001_0001,
            serial=self.serial,
            alias=self.alias,
            emulation=True,
            pdi_type=0x00,
            mailbox=None,
            sync_managers=(),
            fmmus=(),
            rx_pdos=(),
            tx_pdos=(),
            clock=True,
            current_milliampere=-2000,
        )
