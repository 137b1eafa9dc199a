"""Models of devices and segments: descriptions, topology, diagnosis. No I/O."""
