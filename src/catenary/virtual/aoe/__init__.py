"""Device side of ADS over EtherCAT (AoE)."""
