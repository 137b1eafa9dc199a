"""What a device is: SII, object dictionary, topology; what its counters say. No I/O."""
