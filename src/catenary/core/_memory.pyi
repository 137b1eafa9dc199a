"""Memory of the cycle; its state is part of `Engine.scheduling`."""

def amount(size: int) -> str:
    """Return a number of bytes as text: "1.2 MB"."""

def reason(error: int) -> str:
    """Return the reason why memory is not locked, and a remedy. `error`: errno of mlock."""
