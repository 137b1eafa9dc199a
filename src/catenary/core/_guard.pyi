"""Safety of one axis in one cycle; used by the compiled modules only."""
