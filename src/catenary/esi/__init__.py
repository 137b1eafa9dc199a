"""EtherCAT SubDevice Information (ESI, ETG.2000): vendors' device description files."""
