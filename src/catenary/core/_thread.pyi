"""The native thread; used by the compiled modules only."""
