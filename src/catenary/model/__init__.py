"""Model of devices and segments: SII, object dictionary, topology, diagnosis. No I/O."""
