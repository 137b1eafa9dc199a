"""EtherCAT SubDevice Information (ESI, ETG.2000): vendors' device description files."""

from catenary.esi.reader import read_device, read_esi, read_module

__all__ = ["read_device", "read_esi", "read_module"]
