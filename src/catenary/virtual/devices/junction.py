"""Junction, at which the line branches. It has no process data and no mailbox."""

from __future__ import annotations

from catenary.virtual.description import Description
from catenary.virtual.devices.device import Device


class Junction(Device):
    """Junction with 3 or 4 ports. Port 0 leads towards the MainDevice."""

    kind = "junction"

    def __init__(
        self, *, name: str = "", alias: int = 0, serial: int = 0, port_count: int = 4
    ) -> None:
        if port_count not in (3, 4):
            raise ValueError(f"port_count must be 3 or 4, not {port_count}")
        super().__init__(
            name=name or "Catenary virtual junction", alias=alias, serial=serial, lrw=True
        )
        self.ports = tuple(range(port_count))

    def description(self) -> Description:
        return Description(
            name=self.name,
            order=f"CVJ{len(self.ports):03d}",
            group="Couplers",
            product_code=0x0001_0100 + len(self.ports),
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
            ports=self.ports,
        )
