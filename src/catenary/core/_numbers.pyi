"""Numbers in a process image; used by the compiled modules only."""
